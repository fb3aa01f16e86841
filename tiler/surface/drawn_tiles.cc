#include "tiler/surface/drawn_tiles.h"

#include <algorithm>
#include <cmath>

namespace terrace::tiler {
namespace {

// The tile beyond the northern or southern edge that the point is nearest to.
geo::TileKey NeighbourAt(const geo::TileKey& key, const dem::GeoPosition& point) {
  const double row = (point.latitude + 90) / 180 * static_cast<double>(geo::TileRows(key.level));
  return geo::Neighbour(key, 0, row - static_cast<double>(key.y) < 0.5 ? -1 : 1);
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

std::optional<std::uint32_t> TileNumbers::Find(const geo::TileKey& key) const {
  const auto found = numbers_.find(key);
  return found == numbers_.end() ? std::nullopt : std::optional(found->second);
}

std::uint32_t TileNumbers::Add(const geo::TileKey& key) {
  keys_.push_back(key);
  return numbers_[key] = static_cast<std::uint32_t>(keys_.size() - 1);
}

Result<std::uint32_t> TileNumbers::NumberAt(const dem::GeoPosition& point) {
  int level = level_;
  geo::TileKey key = TileAt(point, level);
  while (level > 0 && !has_tile_(key)) key = TileAt(point, --level);
  if (const std::optional<std::uint32_t> known = Find(key)) return *known;
  if (keys_.size() - beside_ < kMaxTilesRead) return Add(key);
  return MakeError(
      ErrorCode::kInvalidArgument,
      "{} lie in more than {} tiles of level {}, which is the most for one request; ask for fewer, or for a "
      "shallower level",
      subject_, kMaxTilesRead, level_);
}

std::optional<std::uint32_t> TileNumbers::NumberBeside(const geo::TileKey& key) {
  if (!geo::IsValid(key) || !has_tile_(key)) return std::nullopt;
  if (const std::optional<std::uint32_t> known = Find(key)) return known;
  if (beside_ == kMaxTilesRead) return std::nullopt;
  ++beside_;
  return Add(key);
}

Result<const DrawnMesh*> DrawnTiles::MeshOf(std::uint32_t number) {
  meshes_.resize(numbers_.keys().size());
  if (meshes_[number] == nullptr) {
    Result<std::shared_ptr<const DrawnMesh>> made = find_mesh_(numbers_.keys()[number]);
    if (!made) return tl::unexpected(std::move(made).error());
    mesh_bytes_ += (*made)->bytes();
    if (mesh_bytes_ > kMaxMeshBytes) {
      return MakeError(
          ErrorCode::kInvalidArgument,
          "{}: the meshes of their tiles take more than {} MiB; ask for a smaller part at once, or for a larger "
          "error",
          numbers_.subject(), kMaxMeshBytes >> 20);
    }
    meshes_[number] = *std::move(made);
  }
  return meshes_[number].get();
}

Result<DrawnTiles::Reading> DrawnTiles::ReadAt(const dem::GeoPosition& point, std::uint32_t own,
                                               const std::stop_token& stop) {
  const Result<const DrawnMesh*> inside = MeshOf(own);
  if (!inside) return tl::unexpected(inside.error());
  if (const std::optional<DrawnPoint> met = (*inside)->InOwnBucket(point)) return Reading{*met, own};
  std::uint32_t neighbour = own;
  if (!(*inside)->IsFarFromParallels(point)) {
    neighbour = numbers_.NumberBeside(NeighbourAt(numbers_.keys()[own], point)).value_or(own);
  }
  const Result<const DrawnMesh*> beyond = MeshOf(neighbour);
  if (!beyond) return tl::unexpected(beyond.error());
  if (neighbour != own) {
    if (const std::optional<DrawnPoint> met = (*beyond)->InOwnBucket(point)) return Reading{*met, neighbour};
  }
  // On shallow levels all triangles are examined.
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the heights any more");
  const DrawnPoint nearest = (*inside)->Nearest(point);
  if (!nearest.is_beside || neighbour == own) return Reading{nearest, own};
  const DrawnPoint there = (*beyond)->Nearest(point);
  return there.is_beside ? Reading{nearest, own} : Reading{there, neighbour};
}

}  // namespace terrace::tiler
