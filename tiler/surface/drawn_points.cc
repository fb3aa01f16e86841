#include "tiler/surface/drawn_points.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "engine/geo/error_ladder.h"

namespace terrace::tiler {
namespace {

// Points between two checks of the stop token.
constexpr std::size_t kStopPeriod = 1024;

tl::unexpected<Error> Stopped() { return MakeError(ErrorCode::kCancelled, "nobody waits for the heights any more"); }

// The tile beyond the northern or southern edge that the point is nearest to.
std::optional<geo::TileKey> NeighbourOf(const HasTile& has_tile, const geo::TileKey& key,
                                        const dem::GeoPosition& point) {
  const double row = (point.latitude + 90) / 180 * static_cast<double>(geo::TileRows(key.level));
  const std::int64_t step = row - static_cast<double>(key.y) < 0.5 ? -1 : 1;
  const geo::TileKey neighbour{key.level, key.x, key.y + step};
  return geo::IsValid(neighbour) && has_tile(neighbour) ? std::optional(neighbour) : std::nullopt;
}

std::array<float, 3> EastNorthUp(const geo::Vec3& normal, const dem::GeoPosition& point) {
  const geo::Vec3 up = geo::SurfaceNormal(point.longitude, point.latitude);
  const double longitude = geo::ToRadians(point.longitude);
  const geo::Vec3 east{-std::sin(longitude), std::cos(longitude), 0}, north = geo::Cross(up, east);
  return {static_cast<float>(geo::Dot(normal, east)), static_cast<float>(geo::Dot(normal, north)),
          static_cast<float>(geo::Dot(normal, up))};
}

}  // namespace

geo::TileKey TileAt(const dem::GeoPosition& point, int level) {
  const double side = 180.0 / static_cast<double>(geo::TileRows(level));
  const auto number = [side](double degrees, std::int64_t count) {
    return std::clamp<std::int64_t>(static_cast<std::int64_t>(std::floor(degrees / side)), 0, count - 1);
  };
  const double longitude = point.longitude == 180 ? -180 : point.longitude;
  return {level, number(longitude + 180, geo::TileColumns(level)), number(point.latitude + 90, geo::TileRows(level))};
}

geo::TileKey DeepestTileAt(const HasTile& has_tile, const dem::GeoPosition& point, int level) {
  geo::TileKey key = TileAt(point, level);
  while (level > 0 && !has_tile(key)) key = TileAt(point, --level);
  return key;
}

Result<int> LevelOf(const DrawnSurface& surface, int max_level, double error_fraction) {
  if (surface.level && *surface.level > max_level) {
    return MakeError(ErrorCode::kInvalidArgument, "level: the dataset has levels from 0 to {}", max_level);
  }
  if (surface.level) return *surface.level;
  if (!surface.requested.error_m) return max_level;
  int level = 0;
  while (level < max_level && geo::DefaultError(level, error_fraction) > *surface.requested.error_m) ++level;
  return level;
}

Result<PointHeights> ReadDrawnPoints(const HasTile& has_tile, int level, std::span<const dem::GeoPosition> points,
                                     bool normals, const MeshOfTile& mesh_of, const std::stop_token& stop) {
  PointHeights read;
  read.heights.resize(points.size());
  read.tile_of_point.resize(points.size());
  if (normals) read.normals.resize(points.size());
  std::map<geo::TileKey, std::uint32_t, IsTileBefore> numbers;
  std::vector<std::shared_ptr<const DrawnMesh>> meshes;
  const auto number_of = [&](const geo::TileKey& key) -> Result<std::uint32_t> {
    const auto [found, is_new] = numbers.try_emplace(key, static_cast<std::uint32_t>(read.tiles.size()));
    if (!is_new) return found->second;
    if (read.tiles.size() == kMaxDrawnTiles) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "surface: the points lie in more than {} tiles of level {}, which is the most for one request; "
                       "ask for fewer points, or for a shallower level",
                       kMaxDrawnTiles, level);
    }
    read.tiles.push_back(key);
    meshes.emplace_back();
    return found->second;
  };
  // All tiles are counted before the first is made.
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i % kStopPeriod == 0 && stop.stop_requested()) return Stopped();
    const Result<std::uint32_t> number = number_of(DeepestTileAt(has_tile, points[i], level));
    if (!number) return tl::unexpected(number.error());
    read.tile_of_point[i] = *number;
  }
  const auto made = [&](std::uint32_t number) -> Result<void> {
    if (meshes[number]) return {};
    Result<std::shared_ptr<const DrawnMesh>> mesh = mesh_of(read.tiles[number]);
    if (!mesh) return tl::unexpected(std::move(mesh).error());
    meshes[number] = *std::move(mesh);
    return {};
  };
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (i % kStopPeriod == 0 && stop.stop_requested()) return Stopped();
    const std::uint32_t own = read.tile_of_point[i];
    if (const Result<void> ready = made(own); !ready) return tl::unexpected(ready.error());
    std::optional<DrawnPoint> drawn = meshes[own]->AtBucket(points[i]);
    if (!drawn) {
      // On shallow levels all triangles are examined.
      if (stop.stop_requested()) return Stopped();
      drawn = meshes[own]->Nearest(points[i]);
    }
    const auto key = drawn->is_beside ? NeighbourOf(has_tile, read.tiles[own], points[i]) : std::nullopt;
    // A neighbour beyond the limit of tiles is not read, because the client did not ask for it.
    if (key && (numbers.contains(*key) || read.tiles.size() < kMaxDrawnTiles)) {
      const Result<std::uint32_t> other = number_of(*key);
      if (const Result<void> ready = made(*other); !ready) return tl::unexpected(ready.error());
      std::optional<DrawnPoint> beyond = meshes[*other]->AtBucket(points[i]);
      if (!beyond) beyond = meshes[*other]->Nearest(points[i]);
      if (!beyond->is_beside) drawn = beyond, read.tile_of_point[i] = *other;
    }
    read.heights[i] = static_cast<float>(drawn->height_m);
    if (normals) read.normals[i] = EastNorthUp(drawn->normal, points[i]);
  }
  return read;
}

}  // namespace terrace::tiler
