// The tiles that one request reads heights from.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "engine/geo/tile_key.h"
#include "tiler/surface/drawn_mesh.h"

namespace terrace::tiler {

// Limit of the tiles that the points or rays of one request lie in: each of them may have to be made.
inline constexpr std::size_t kMaxTilesRead = 64;
// Limit of the meshes that one request keeps. Usual ones take some hundred KB, those at the limit of vertices 5 MB.
inline constexpr std::size_t kMaxMeshBytes = std::size_t{256} << 20;

// Whether a tile exists.
using HasTile = std::function<bool(const geo::TileKey&)>;
// Returns the mesh of an available tile.
using FindMesh = std::function<Result<std::shared_ptr<const DrawnMesh>>(const geo::TileKey&)>;

// The tile of a level that contains a point. On an edge between two tiles: the eastern and the northern one.
geo::TileKey TileAt(const dem::GeoPosition& point, int level);

// An order of tiles, for maps.
struct IsTileBefore {
  bool operator()(const geo::TileKey& a, const geo::TileKey& b) const {
    return std::tie(a.level, a.y, a.x) < std::tie(b.level, b.y, b.x);
  }
};

// Numbers tiles in the order in which a request reads them.
class TileNumbers {
 public:
  // Reads tiles of `level`, and ancestors where these do not exist. `subject`: what the client asked for, for messages,
  // as "surface: the points"; must outlive this object.
  TileNumbers(HasTile has_tile, int level, std::string_view subject)
      : has_tile_(std::move(has_tile)), level_(level), subject_(subject) {}

  // Number of the deepest tile that contains a point. kInvalidArgument, with a message for the client: the tile would
  // be one more than kMaxTilesRead.
  Result<std::uint32_t> NumberAt(const dem::GeoPosition& point);
  // Number of a tile beside a numbered one. It gets a number if it has none. Nothing if the tile does not exist, or if
  // this function has already added kMaxTilesRead. Tiles that are added here do not count for NumberAt.
  std::optional<std::uint32_t> NumberBeside(const geo::TileKey& key);

  const std::vector<geo::TileKey>& keys() const { return keys_; }  // by number
  int level() const { return level_; }
  std::string_view subject() const { return subject_; }

 private:
  std::optional<std::uint32_t> Find(const geo::TileKey& key) const;
  std::uint32_t Add(const geo::TileKey& key);

  HasTile has_tile_;
  int level_;
  std::size_t beside_ = 0;  // tiles that NumberBeside added
  std::string_view subject_;
  std::map<geo::TileKey, std::uint32_t, IsTileBefore> numbers_;
  std::vector<geo::TileKey> keys_;
};

// The drawn surface of a level: the meshes of its tiles, each made when it is first needed.
class DrawnTiles {
 public:
  // Arguments as those of TileNumbers.
  DrawnTiles(HasTile has_tile, int level, std::string_view subject, FindMesh find_mesh)
      : numbers_(std::move(has_tile), level, subject), find_mesh_(std::move(find_mesh)) {}

  TileNumbers& numbers() { return numbers_; }
  // kInvalidArgument: the meshes of the request take more than kMaxMeshBytes. Other errors: those of `find_mesh`.
  Result<const DrawnMesh*> MeshOf(std::uint32_t number);

  struct Reading {
    DrawnPoint point;
    std::uint32_t tile = 0;  // number
  };
  // The surface at a point in the tile with the number `own`. Near its northern or southern edge the plumb line may
  // meet no triangle of this tile. If it meets one of the neighbour there, the surface is the neighbour's. kCancelled:
  // a stop was requested. Other errors: those of MeshOf.
  Result<Reading> ReadAt(const dem::GeoPosition& point, std::uint32_t own, const std::stop_token& stop);

 private:
  TileNumbers numbers_;
  FindMesh find_mesh_;
  std::vector<std::shared_ptr<const DrawnMesh>> meshes_;  // by number; null: not made yet
  std::size_t mesh_bytes_ = 0;
};

}  // namespace terrace::tiler
