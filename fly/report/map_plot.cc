#include "fly/report/map_plot.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "engine/core/plain_number.h"
#include "fly/report/plot.h"
#include "fly/scene/volume.h"

namespace terrace::fly {
namespace {

constexpr double kWidth = 1304, kHeight = 620, kMargin = 30;
constexpr int kColoredLevels = 7;  // the deepest; shallower tiles have the colour of the first of them

struct Frame {
  double longitude = 0, latitude = 0;  // of the middle
  double pixels_per_degree = 1;        // to the north
  double east_scale = 1;               // a degree of longitude in degrees of latitude

  double X(double lon) const {
    return kWidth / 2 + std::remainder(lon - longitude, 360.0) * east_scale * pixels_per_degree;
  }
  double Y(double lat) const { return kHeight / 2 - (lat - latitude) * pixels_per_degree; }
};

Frame FrameOf(const std::vector<GeodeticPoint>& track) {
  Frame frame;
  double west = 0, east = 0, south = 90, north = -90, height = 0;
  for (const GeodeticPoint& point : track) {
    const double lon = std::remainder(point.longitude - track.front().longitude, 360.0);
    west = std::min(west, lon);
    east = std::max(east, lon);
    south = std::min(south, point.latitude);
    north = std::max(north, point.latitude);
    height = std::max(height, point.height_m);
  }
  frame.longitude = track.front().longitude + (west + east) / 2;
  frame.latitude = (south + north) / 2;
  frame.east_scale = std::max(0.05, std::cos(geo::ToRadians(frame.latitude)));
  // Five times the height of the camera on each side: what it sees in detail.
  const double around = std::clamp(height * 5 / 111'000, 0.02, 60.0);
  frame.pixels_per_degree = std::min((kHeight - 2 * kMargin) / (north - south + 2 * around),
                                     (kWidth - 2 * kMargin) / ((east - west) * frame.east_scale + 2 * around));
  return frame;
}

void AddTile(const Frame& frame, const geo::TileKey& key, const std::string& color, std::string& svg) {
  const Rectangle r = RectangleOf(key);
  const double x = frame.X((r.west + r.east) / 2),
               width = (r.east - r.west) * frame.east_scale * frame.pixels_per_degree;
  const double left = std::max(x - width / 2, -5.0), right = std::min(x + width / 2, kWidth + 5);
  const double top = std::max(frame.Y(r.north), -5.0), bottom = std::min(frame.Y(r.south), kHeight + 5);
  if (left >= right || top >= bottom) return;
  fmt::format_to(std::back_inserter(svg),
                 R"(<rect x="{:.1f}" y="{:.1f}" width="{:.1f}" height="{:.1f}" fill="{}"><title>{}</title></rect>)",
                 left, top, right - left, bottom - top, color, geo::ToString(key));
}

void AddScaleBar(const Frame& frame, std::string& svg) {
  const double pixels_per_km = frame.pixels_per_degree / 111.2;
  const double km = RoundUp(120 / pixels_per_km) / 2;
  fmt::format_to(
      std::back_inserter(svg),
      R"(<path class="bar" d="M{0:.1f} {1:.1f}v6h{2:.1f}v-6"/><text class="tick" x="{3:.1f}" y="{4:.1f}" text-anchor="middle">{5} km</text>)",
      20.0, kHeight - 24, km * pixels_per_km, 20 + km * pixels_per_km / 2, kHeight - 28, PlainNumber(km));
}

// A colour for a level, from violet for shallow ones to yellow for the deepest.
std::string ColorOfLevel(int level, int shallowest, int deepest) {
  // Samples of the colour map viridis, whose brightness ascends: it is readable in greyscale.
  static constexpr std::array<std::array<int, 3>, 6> kMap = {
      {{68, 1, 84}, {65, 68, 135}, {42, 120, 142}, {34, 168, 132}, {122, 209, 81}, {253, 231, 37}}};
  const double fraction = deepest <= shallowest
                              ? 1
                              : std::clamp(static_cast<double>(level - shallowest) / (deepest - shallowest), 0.0, 1.0);
  const double at = fraction * (kMap.size() - 1);
  const auto low = std::min(static_cast<std::size_t>(at), kMap.size() - 2);
  const auto mix = [&](std::size_t channel) {
    return kMap[low][channel] + (kMap[low + 1][channel] - kMap[low][channel]) * (at - static_cast<double>(low));
  };
  return fmt::format("rgb({:.0f},{:.0f},{:.0f})", mix(0), mix(1), mix(2));
}

}  // namespace

std::string MapOf(const std::set<std::tuple<int, std::int64_t, std::int64_t>>& tiles,
                  const std::vector<GeodeticPoint>& track) {
  if (tiles.empty() || track.empty()) return {};
  const Frame frame = FrameOf(track);
  const int deepest = std::get<0>(*tiles.rbegin());
  const int shallowest = std::max(std::get<0>(*tiles.begin()), deepest - kColoredLevels + 1);
  std::string svg;
  for (const auto& [level, x, y] : tiles) {
    AddTile(frame, {level, x, y}, ColorOfLevel(level, shallowest, deepest), svg);
  }
  std::string points;
  for (const GeodeticPoint& point : track) {
    fmt::format_to(std::back_inserter(points), "{:.1f},{:.1f} ", frame.X(point.longitude), frame.Y(point.latitude));
  }
  fmt::format_to(std::back_inserter(svg),
                 R"(<polyline class="halo" points="{0}"/><polyline class="track" points="{0}"/>)", points);
  fmt::format_to(std::back_inserter(svg),
                 R"(<circle class="start" cx="{:.1f}" cy="{:.1f}" r="6"><title>start</title></circle>)",
                 frame.X(track.front().longitude), frame.Y(track.front().latitude));
  AddScaleBar(frame, svg);
  std::string legend;
  for (int level = shallowest; level <= deepest; ++level) {
    fmt::format_to(std::back_inserter(legend), R"(<span class="key"><i style="background:{}"></i>{}{}</span>)",
                   ColorOfLevel(level, shallowest, deepest), level == shallowest ? "up to level " : "", level);
  }
  return fmt::format(
      R"(<figure class="wide"><figcaption><b>The path over the tiles that were loaded</b><p>Rectangles: tiles that )"
      R"(any client loaded. Line: the path of the first client; the dot is its start.</p><div>{}</div></figcaption><svg class="map" viewBox="0 0 {:.0f} {:.0f}" )"
      R"(role="img" aria-label="map">{}</svg></figure>)",
      legend, kWidth, kHeight, svg);
}

}  // namespace terrace::fly
