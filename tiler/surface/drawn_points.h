// Heights of points, of the sources or as drawn: of the mesh that a client decodes at some level and error.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "proto/gltf/glb_tile.h"
#include "tiler/surface/drawn_tiles.h"
#include "tiler/tile/requested_error.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

// Heights of a dataset at points, NaN where it has none.
struct PointHeights {
  std::vector<float> heights;
  std::vector<std::uint8_t> filled = {};           // by point: 1 where a void was filled in; empty: none was
  std::vector<std::array<float, 3>> normals = {};  // by point: unit, east, north, up; empty: not wanted
  // Of drawn surfaces: the tiles that were read, and the index of each point's tile. Empty: heights of the sources.
  std::vector<geo::TileKey> tiles = {};
  std::vector<std::uint32_t> tile_of_point = {};
};

// The surface to read. The error and the rest are those of a tile's URL.
struct DrawnSurface {
  std::optional<int> level;  // nothing: LevelOf chooses the first level whose default error is at most the requested
                             // one, or the deepest
  RequestedError requested;
  TileFormat format = TileFormat::kQuantizedMesh;                     // or kGlb
  proto::GlbCompression compression = proto::GlbCompression::kDraco;  // kGlb only
};

// Level of the surface. kInvalidArgument: the dataset has no such level.
Result<int> LevelOf(const DrawnSurface& surface, int max_level, double error_fraction);

// Heights at points, with the tile of each. A point belongs to the tile of `level` that it lies in, or to its deepest
// available ancestor. On an edge between two tiles it belongs to the eastern and the northern one. Beside an edge where
// only the neighbour has triangles, it belongs to the neighbour. In holes heights and normals are NaN. `normals`: adds
// normals. kInvalidArgument: too many tiles.
Result<PointHeights> ReadDrawnPoints(const HasTile& has_tile, int level, std::span<const dem::GeoPosition> points,
                                     bool normals, const MeshOfTile& mesh_of, const std::stop_token& stop);

}  // namespace terrace::tiler
