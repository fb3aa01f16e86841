#include "engine/crs/footprint.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace terrace::dem {
namespace {

constexpr int kPointsPerSide = 64;

// Pixel positions around the raster's edge, each corner once.
std::vector<Position> Outline(double width, double height) {
  std::vector<Position> outline;
  outline.reserve(4 * kPointsPerSide);
  for (int i = 0; i < kPointsPerSide; ++i) outline.push_back({width * i / kPointsPerSide, 0});
  for (int i = 0; i < kPointsPerSide; ++i) outline.push_back({width, height * i / kPointsPerSide});
  for (int i = 0; i < kPointsPerSide; ++i) outline.push_back({width - width * i / kPointsPerSide, height});
  for (int i = 0; i < kPointsPerSide; ++i) outline.push_back({0, height - height * i / kPointsPerSide});
  return outline;
}

// Whether the raster contains this pole, or ends so close to it that two points of the outline may lie on both sides of
// it, or that rounding may put it beside the raster.
bool HoldsPole(const Georeference& georeference, double latitude) {
  std::array<Position, 4> poles{{{0, latitude}, {90, latitude}, {180, latitude}, {-90, latitude}}};
  georeference.ToPixels(poles);
  const Position& pole = poles[0];
  // On a map where the pole is a line, the outline has the extent of the raster.
  for (const Position& other : poles) {
    if (!(std::hypot(other.x - pole.x, other.y - pole.y) < 1)) return false;
  }
  const auto holds = [](double place, int side) {
    const double margin = std::max(static_cast<double>(side) / kPointsPerSide, 1e-6);
    return place >= -margin && place <= side + margin;
  };
  return holds(pole.x, georeference.width()) && holds(pole.y, georeference.height());
}

double WrappedTurn(double degrees) { return degrees - 360 * std::round(degrees / 360); }

// Normalizes west to -180 .. 180, limits the width to 360 degrees, and clamps to the poles.
Footprint Normalized(Footprint box) {
  box.south = std::clamp(box.south, -90.0, 90.0);
  box.north = std::clamp(box.north, -90.0, 90.0);
  if (box.east - box.west >= 360) {
    box.west = -180;
    box.east = 180;
    return box;
  }
  double west = std::remainder(box.west, 360);  // exact
  if (west == 180) west = -180;
  box.east += west - box.west;
  box.west = west;
  return box;
}

}  // namespace

bool HasUnknownOutline(const Georeference& georeference) {
  std::vector<Position> outline = Outline(georeference.width(), georeference.height());
  georeference.ToDegrees(outline);
  return std::ranges::any_of(outline, [](const Position& p) { return !std::isfinite(p.x) || !std::isfinite(p.y); });
}

Footprint Footprint::Of(const Georeference& georeference) {
  std::vector<Position> outline = Outline(georeference.width(), georeference.height());
  georeference.ToDegrees(outline);
  Footprint box{1e9, 1e9, -1e9, -1e9};
  double longitude = outline.front().x;  // continuous around the edge, without jumps at the antimeridian
  double turn = 0;
  for (std::size_t i = 0; i <= outline.size(); ++i) {
    const Position& point = outline[i % outline.size()];
    if (!std::isfinite(point.x) || !std::isfinite(point.y)) return {};
    // Affine longitudes have no jumps, and one step along a global raster may exceed half a turn.
    const double step = georeference.is_affine() ? point.x - longitude : WrappedTurn(point.x - longitude);
    longitude += step;
    turn += step;
    box.west = std::min(box.west, longitude);
    box.east = std::max(box.east, longitude);
    box.south = std::min(box.south, point.y);
    box.north = std::max(box.north, point.y);
  }
  if (georeference.wrap_columns() > 0) box.east = box.west + 360;
  if (!georeference.is_geographic_grid()) {
    const bool south_pole = HoldsPole(georeference, -90), north_pole = HoldsPole(georeference, 90);
    if (south_pole) box.south = -90;
    if (north_pole) box.north = 90;
    if (south_pole || north_pole || std::abs(turn) > 180) box.east = box.west + 360;
  }
  return Normalized(box);
}

Footprint Footprint::Of(const GeoBounds& bounds) {
  return {bounds.west, bounds.south, bounds.west > bounds.east ? bounds.east + 360 : bounds.east, bounds.north};
}

bool Footprint::Touches(const Footprint& other) const {
  return Touches(other.west, other.south, other.east - other.west, other.north - other.south);
}

GeoBounds Footprint::Bounds() const { return {west, south, east > 180 ? east - 360 : east, north}; }

Footprint Footprint::Padded() const {
  // Between two points of the outline, the edge deviates by less than a 64th of its chord, which is a 4096th of the
  // side.
  constexpr double kShare = 0.01, kMinMargin = 1e-6;
  const double x = (east - west) * kShare + kMinMargin, y = (north - south) * kShare + kMinMargin;
  return Normalized({west - x, south - y, east + x, north + y});
}

bool Footprint::Touches(double box_west, double box_south, double box_width, double box_height) const {
  if (box_south > north || box_south + box_height < south) return false;
  if (all_longitudes()) return true;
  const double offset = box_west - west - 360 * std::floor((box_west - west) / 360);  // 0 <= offset < 360
  return offset <= east - west || offset + box_width >= 360;
}

Result<void> CheckOverlap(const Footprint& footprint, const GeoBounds& around, const std::string& path) {
  if (footprint.Touches(Footprint::Of(around))) return {};
  const GeoBounds bounds = footprint.Bounds();
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: covers longitudes {:.4f} to {:.4f} and latitudes {:.4f} to {:.4f}, nothing of the dataset at "
                   "{:.4f} to {:.4f} and {:.4f} to {:.4f}; name a raster of the same area, or correct its georeference "
                   "with `gdal_translate -a_srs EPSG:XXXX -a_ullr west north east south in out`",
                   path, bounds.west, bounds.east, bounds.south, bounds.north, around.west, around.east, around.south,
                   around.north);
}

std::vector<geo::TileRange> TilesOverlapping(const Footprint& footprint, int level) {
  const std::int64_t columns = geo::TileColumns(level), rows = geo::TileRows(level);
  const double tile = 180.0 / static_cast<double>(rows);
  const auto first = [&](double degrees, std::int64_t count) {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(degrees / tile)), 0, count - 1);
  };
  const auto last = [&](double degrees, std::int64_t count) {  // a tile that shares only an edge is not touched
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::ceil(degrees / tile)) - 1, 0, count - 1);
  };
  const std::int64_t south = first(footprint.south + 90, rows);
  const std::int64_t north = std::max(south, last(footprint.north + 90, rows));
  const std::int64_t west = first(footprint.west + 180, columns);
  if (footprint.east <= 180) return {{west, south, std::max(west, last(footprint.east + 180, columns)), north}};
  const std::int64_t east = last(footprint.east - 180, columns);
  if (east + 1 >= west) return {{0, south, columns - 1, north}};
  return {{0, south, east, north}, {west, south, columns - 1, north}};
}

}  // namespace terrace::dem
