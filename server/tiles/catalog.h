// What is served at one moment: the datasets, and the functions that make answers from them.
//
// Immutable. A request uses the catalog it began with until its end, and so does a build that it starts: answers never
// mix two catalogs.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "engine/dem/gdal/gdal_runtime.h"
#include "server/tiles/dataset_view.h"
#include "tiler/area/area_mesh.h"
#include "tiler/encoded_tile.h"
#include "tiler/tile_request.h"

namespace terrace::server {

// Blocking; called on many threads at once. An exception counts as kUnavailable. TileRequest::dataset is an index into
// the catalog's datasets.
using TileBuilder = std::function<Result<tiler::EncodedTile>(const tiler::TileRequest&, std::stop_token)>;

// Heights of a dataset at points, NaN where it has none.
struct PointHeights {
  PointHeights() = default;
  // Heights of which none was filled in. Implicit on purpose.
  PointHeights(std::vector<float> measured) : heights(std::move(measured)) {}  // NOLINT(google-explicit-constructor)

  std::vector<float> heights;
  std::vector<std::uint8_t> filled;  // by point: 1 where a void was filled in; empty: none was
};

// Blocking; called on many threads at once.
using PointReader = std::function<Result<PointHeights>(std::uint32_t dataset, std::span<const dem::GeoPosition> points,
                                                       dem::HeightDatum, std::stop_token)>;

// Statistics of reading sources: GDAL's since the start; those of datasets, by name, since they were opened.
struct SourceStats {
  std::vector<std::pair<std::string, dem::SampleCounts>> samples;
  dem::GdalCounts gdal;
};

// Makes meshes of areas, by the dataset's index. `plan` refuses areas that are too large; it reads nothing and returns
// at once. `build` blocks. Both are called on many threads at once.
struct AreaMesher {
  std::function<Result<tiler::AreaPlan>(std::uint32_t dataset, const tiler::AreaRequest&)> plan;
  std::function<Result<tiler::EncodedTile>(std::uint32_t dataset, const tiler::AreaPlan&, const tiler::AreaRequest&,
                                           std::stop_token)>
      build;
};

// The functions keep alive what they need.
struct Catalog {
  std::vector<DatasetView> datasets;
  TileBuilder build;
  PointReader read_points;
  AreaMesher area_mesher;
  std::function<SourceStats()> source_stats = {};  // may be empty
};

using CatalogPtr = std::shared_ptr<const Catalog>;

}  // namespace terrace::server
