#include "tiler/surface/drawn_points.h"

namespace terrace::tiler {
namespace {

// Points between two checks of the stop token.
constexpr std::size_t kPointsBetweenStops = 1024;

tl::unexpected<Error> Stopped() { return MakeError(ErrorCode::kCancelled, "nobody waits for the heights any more"); }

std::array<float, 3> EastNorthUp(const geo::Vec3& normal, const dem::GeoPosition& point) {
  const geo::SinCos longitude = geo::RoundedSinCos(point.longitude);
  const geo::Vec3 up = geo::SurfaceNormal(longitude, geo::RoundedSinCos(point.latitude));
  const geo::Vec3 east{-longitude.sin, longitude.cos, 0}, north = geo::Cross(up, east);
  return {static_cast<float>(geo::Dot(normal, east)), static_cast<float>(geo::Dot(normal, north)),
          static_cast<float>(geo::Dot(normal, up))};
}

}  // namespace

Result<PointHeights> ReadDrawnPoints(const HasTile& has_tile, int level, std::span<const dem::GeoPosition> points,
                                     bool normals, const FindMesh& find_mesh, const std::stop_token& stop) {
  PointHeights read;
  read.heights.resize(points.size());
  read.tile_of_point.resize(points.size());
  if (normals) read.normals.resize(points.size());
  DrawnTiles tiles(has_tile, level, "surface: the points", find_mesh);
  // All tiles are counted before the first is made.
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i % kPointsBetweenStops == 0 && stop.stop_requested()) return Stopped();
    const Result<std::uint32_t> number = tiles.numbers().NumberAt(points[i]);
    if (!number) return tl::unexpected(number.error());
    read.tile_of_point[i] = *number;
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i % kPointsBetweenStops == 0 && stop.stop_requested()) return Stopped();
    const Result<DrawnTiles::Reading> drawn = tiles.ReadAt(points[i], read.tile_of_point[i], stop);
    if (!drawn) return tl::unexpected(drawn.error());
    read.tile_of_point[i] = drawn->tile;
    read.heights[i] = static_cast<float>(drawn->point.height_m);
    if (normals) read.normals[i] = EastNorthUp(drawn->point.normal, points[i]);
  }
  read.tiles = tiles.numbers().keys();
  return read;
}

}  // namespace terrace::tiler
