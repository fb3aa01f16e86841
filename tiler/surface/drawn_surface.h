// Which drawn surface a request names: the meshes that clients decode at some level and error.
#pragma once

#include <optional>

#include "engine/core/result.h"
#include "engine/geo/error_ladder.h"
#include "proto/gltf/gltf_types.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

// The surface to read. `requested`, `format` and `compression` mean what they mean in the URL of a tile.
struct DrawnSurface {
  // Nothing: the first level whose default error is at most requested.error_m; the deepest if there is none, or if
  // error_m is not set.
  std::optional<int> level;
  geo::RequestedError requested = {};
  TileFormat format = TileFormat::kQuantizedMesh;         // or kGlb, only if the dataset has sources
  std::optional<proto::GlbCompression> compression = {};  // kGlb only; nothing: Dataset::glb.compression
};

// Level of the surface. kInvalidArgument: the dataset has no such level.
Result<int> LevelOf(const DrawnSurface& surface, int max_level, double error_fraction);

}  // namespace terrace::tiler
