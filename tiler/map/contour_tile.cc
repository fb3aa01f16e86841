#include "tiler/map/contour_tile.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <iterator>
#include <utility>

#include "engine/core/check.h"
#include "engine/export/contour_lines.h"

namespace terrace::tiler {
namespace {

constexpr int kTilePixels = 256;
constexpr int kUnits = proto::kVectorTileExtent / kTilePixels;  // of a pixel
constexpr int kFirst = -kContourBuffer * kUnits, kLast = proto::kVectorTileExtent + kContourBuffer * kUnits;

// Metres, by level from 0; the last for all deeper levels.
constexpr std::uint32_t kIntervals[] = {1000, 1000, 1000, 1000, 1000, 1000, 1000, 500, 500, 200,
                                        200,  100,  50,   20,   10,   10,   5,    2,   1};

// Node positions count from the middle of the margin's first pixel. Rounding does not depend on the tile: half units
// are rounded up, to the south and east.
proto::TilePoint UnitsOf(const dem::ContourPoint& point) {
  const auto units = [](double node) {
    return static_cast<std::int32_t>(std::floor((node - kContourMargin + 0.5) * kUnits + 0.5));
  };
  return {units(point.x), units(point.y)};
}

bool TouchesBuffer(const proto::TilePoint& a, const proto::TilePoint& b) {
  return std::max(a.x, b.x) >= kFirst && std::min(a.x, b.x) <= kLast && std::max(a.y, b.y) >= kFirst &&
         std::min(a.y, b.y) <= kLast;
}

// Points that are left out lie at most this far from the line without them: an eighth of a pixel.
constexpr std::int64_t kTolerance = 2;

// Away from the edges, where neighbouring tiles need the same points.
bool IsAwayFromEdges(const proto::TilePoint& point) {
  constexpr int kNear = kContourBuffer * kUnits;
  const auto is_inside = [](std::int32_t at) { return at > kNear && at < proto::kVectorTileExtent - kNear; };
  return is_inside(point.x) && is_inside(point.y);
}

// The square of a point's distance from a piece of line, times the square of the piece's length, if that is not 0.
std::int64_t ScaledDistance(const proto::TilePoint& a, const proto::TilePoint& b, const proto::TilePoint& point) {
  const std::int64_t x = b.x - a.x, y = b.y - a.y, to_x = point.x - a.x, to_y = point.y - a.y;
  const std::int64_t length = x * x + y * y, along = x * to_x + y * to_y;
  if (length == 0) return to_x * to_x + to_y * to_y;
  if (along <= 0) return (to_x * to_x + to_y * to_y) * length;
  if (along >= length) return ((to_x - x) * (to_x - x) + (to_y - y) * (to_y - y)) * length;
  const std::int64_t cross = x * to_y - y * to_x;
  return cross * cross;
}

// Douglas and Peucker 1973, on whole numbers: marks the points between two kept ones that must stay. Coordinates differ
// by at most 2^13, so numbers stay below 2^56.
void MarkKept(const std::vector<proto::TilePoint>& line, std::size_t first, std::size_t last,
              std::vector<bool>& keeps) {
  std::vector<std::pair<std::size_t, std::size_t>> open = {{first, last}};
  while (!open.empty()) {
    const auto [from, to] = open.back();
    open.pop_back();
    const proto::TilePoint &a = line[from], &b = line[to];
    const std::int64_t x = b.x - a.x, y = b.y - a.y, length = std::max<std::int64_t>(x * x + y * y, 1);
    std::int64_t farthest = kTolerance * kTolerance * length;
    std::size_t at = 0;
    for (std::size_t i = from + 1; i < to; ++i) {
      const std::int64_t distance = ScaledDistance(a, b, line[i]);
      if (distance <= farthest) continue;
      farthest = distance;
      at = i;
    }
    if (at == 0) continue;
    keeps[at] = true;
    open.emplace_back(from, at);
    open.emplace_back(at, to);
  }
}

void Append(std::vector<proto::TilePoint>& line, const proto::TilePoint& point) {
  if (line.empty() || line.back() != point) line.push_back(point);
}

// Removes points that change the line by at most kTolerance. One point of a small ring is left.
std::vector<proto::TilePoint> Simplified(const std::vector<proto::TilePoint>& line) {
  std::vector<bool> keeps(line.size());
  std::size_t before = 0;  // the kept point before
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (i > 0 && i + 1 < line.size() && IsAwayFromEdges(line[i])) continue;
    keeps[i] = true;
    if (i > before + 1) MarkKept(line, before, i, keeps);
    before = i;
  }
  std::vector<proto::TilePoint> kept;
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (keeps[i]) Append(kept, line[i]);
  }
  return kept;
}

// The parts of a line in the tile and its buffer.
void AddParts(const dem::ContourLine& line, std::vector<std::vector<proto::TilePoint>>& lines) {
  std::vector<proto::TilePoint> part;
  const auto finish = [&] {
    std::vector<proto::TilePoint> kept = Simplified(part);
    if (kept.size() >= 2) lines.push_back(std::move(kept));  // vector tiles have no lines without length
    part.clear();
  };
  for (std::size_t i = 1; i < line.points.size(); ++i) {
    const proto::TilePoint from = UnitsOf(line.points[i - 1]), to = UnitsOf(line.points[i]);
    if (!TouchesBuffer(from, to)) {
      finish();
      continue;
    }
    Append(part, from);
    Append(part, to);
  }
  finish();
}

}  // namespace

std::uint32_t DefaultIntervalCm(int level) {
  const auto last = static_cast<int>(std::size(kIntervals)) - 1;
  return 100 * kIntervals[std::clamp(level, 0, last)];
}

std::uint32_t MinIntervalCm(int level) { return std::max(DefaultIntervalCm(level) / 20, 10u); }

Result<std::vector<proto::ContourFeature>> ContoursOf(const MapHeights& heights, std::uint32_t interval_cm,
                                                      const std::stop_token& stop) {
  TERRACE_CHECK(heights.side == kTilePixels + 2 * kContourMargin && interval_cm > 0);
  const auto metres = [](std::int64_t of_cm) { return static_cast<double>(of_cm) / 100; };
  std::int64_t interval = interval_cm;
  const auto crossings = [&] {
    return dem::CountContourCrossings(heights.heights, heights.side, heights.side, metres(interval));
  };
  while (crossings() > dem::kMaxContourCrossings) interval *= kIndexEvery;
  const auto traced = dem::TraceContours(heights.heights, heights.side, heights.side, metres(interval), stop);
  if (!traced) return tl::unexpected(traced.error());
  std::vector<proto::ContourFeature> features;
  for (const dem::ContourLine& line : *traced) {
    const std::int64_t height_cm = std::llround(line.height / metres(interval)) * interval;
    if (features.empty() || features.back().height_m != metres(height_cm)) {
      const bool is_index = height_cm % (std::int64_t{kIndexEvery} * interval_cm) == 0;
      features.push_back({metres(height_cm), is_index, {}});
    }
    AddParts(line, features.back().lines);
  }
  return features;
}

}  // namespace terrace::tiler
