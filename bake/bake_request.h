// What a bake is asked for, and the archives that it makes: their kinds, levels and tiles.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "archive/manifest.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/error_ladder.h"
#include "proto/tile_extensions.h"
#include "tiler/tile/tile_request.h"
#include "tiler/tile_pipeline.h"

namespace terrace::bake {

struct BakeRequest {
  std::vector<tiler::TileFormat> formats = {tiler::TileFormat::kQuantizedMesh};
  std::optional<std::pair<int, int>> levels = {};  // first and last; nothing: all
  std::optional<dem::GeoBounds> bbox = {};         // tiles that overlap it, and their siblings; nothing: all
  geo::RequestedError requested = {};
  // Extensions of quantized-mesh. Nothing: normals, and the water mask where the dataset has one.
  std::optional<proto::TileExtensions> extensions = {};
  bool compress = true;  // with gzip, where that makes tiles smaller
};

// The manifests of the archives, one for each format, without units. `product`: name and version of the program.
// kInvalidArgument: the dataset does not have the levels, the area or the extensions; the message names valid ones.
Result<std::vector<archive::Manifest>> PlanArchives(const tiler::Dataset& dataset, const BakeRequest& request,
                                                    const std::string& product);

// Restricts the tiles of a dataset to those that overlap `bbox` and their siblings. Both roots stay.
std::vector<std::vector<geo::TileRange>> TilesWithin(const std::vector<std::vector<geo::TileRange>>& available,
                                                     const dem::GeoBounds& bbox);

// The request that builds one tile of an archive.
tiler::TileRequest RequestOf(const archive::Manifest& manifest, const geo::TileKey& key);

}  // namespace terrace::bake
