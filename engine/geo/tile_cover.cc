#include "engine/geo/tile_cover.h"

#include <algorithm>
#include <tuple>

namespace terrace::geo {
namespace {

// Columns without gaps, ends included.
struct Run {
  std::int64_t start, end;
  std::int64_t since;  // first row of the current band
};

std::vector<Run> RunsOf(std::vector<TileRange>& active, std::int64_t row) {
  std::ranges::sort(active, {}, &TileRange::start_x);
  std::vector<Run> runs;
  for (const TileRange& range : active) {
    if (!runs.empty() && range.start_x <= runs.back().end + 1) {
      runs.back().end = std::max(runs.back().end, range.end_x);
    } else {
      runs.push_back({range.start_x, range.end_x, row});
    }
  }
  return runs;
}

}  // namespace

std::vector<TileRange> Disjoint(std::vector<TileRange> ranges) {
  std::erase_if(ranges, IsEmpty);
  std::ranges::sort(ranges, {}, &TileRange::start_y);
  std::vector<std::int64_t> rows;  // where bands of equal columns may begin
  for (const TileRange& range : ranges) {
    rows.push_back(range.start_y);
    rows.push_back(range.end_y + 1);
  }
  std::ranges::sort(rows);
  rows.erase(std::unique(rows.begin(), rows.end()), rows.end());

  std::vector<TileRange> cover, active;
  std::vector<Run> before;
  auto next = ranges.begin();
  for (const std::int64_t row : rows) {
    std::erase_if(active, [row](const TileRange& range) { return range.end_y < row; });
    for (; next != ranges.end() && next->start_y == row; ++next) active.push_back(*next);
    std::vector<Run> runs = RunsOf(active, row);
    auto old = before.begin();
    for (Run& run : runs) {
      for (; old != before.end() && old->start < run.start; ++old) {
        cover.push_back({old->start, old->since, old->end, row - 1});
      }
      if (old == before.end() || old->start != run.start) continue;
      if (old->end == run.end) {
        run.since = old->since;
      } else {
        cover.push_back({old->start, old->since, old->end, row - 1});
      }
      ++old;
    }
    for (; old != before.end(); ++old) cover.push_back({old->start, old->since, old->end, row - 1});
    before = std::move(runs);
  }
  std::ranges::sort(cover, {}, [](const TileRange& range) { return std::tuple(range.start_y, range.start_x); });
  return cover;
}

TileRange BoundingRange(const TileRange& a, const TileRange& b) {
  return {std::min(a.start_x, b.start_x), std::min(a.start_y, b.start_y), std::max(a.end_x, b.end_x),
          std::max(a.end_y, b.end_y)};
}

TileRange Intersection(const TileRange& a, const TileRange& b) {
  return {std::max(a.start_x, b.start_x), std::max(a.start_y, b.start_y), std::min(a.end_x, b.end_x),
          std::min(a.end_y, b.end_y)};
}

bool Contains(const std::vector<TileRange>& ranges, const TileKey& key) {
  return std::ranges::any_of(ranges, [&](const TileRange& range) { return range.Contains(key); });
}

bool IsAvailable(const std::vector<std::vector<TileRange>>& available, const TileKey& key) {
  return IsValid(key) && key.level < static_cast<int>(available.size()) &&
         Contains(available[static_cast<std::size_t>(key.level)], key);
}

std::vector<TileRange> RangesBelow(const std::vector<TileRange>& ranges, const TileKey& key, int level) {
  std::vector<TileRange> parts;
  for (const TileRange& range : ranges) parts.push_back(Intersection(range, TilesBelow(key, level)));
  return Disjoint(std::move(parts));
}

}  // namespace terrace::geo
