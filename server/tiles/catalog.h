// Everything that is served at one moment: the datasets, and how answers about them are made.
//
// Immutable. A request works with the catalog it began with, to its end, and so does the build it starts: what replaces
// a catalog meanwhile is never mixed into an answer.
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
#include "engine/dem/gdal/gdal_settings.h"
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
  // All of them measured. Implicit: heights are such.
  PointHeights(std::vector<float> measured) : heights(std::move(measured)) {}  // NOLINT(google-explicit-constructor)

  std::vector<float> heights;
  std::vector<std::uint8_t> filled;  // by point: 1 where a void was filled in; empty: none was
};

// Blocking; called on many threads at once.
using PointReader = std::function<Result<PointHeights>(std::uint32_t dataset, std::span<const dem::GeoPosition> points,
                                                       dem::HeightDatum, std::stop_token)>;

// What sources were read for: GDAL's numbers since the start, those of datasets, by name, since they were opened.
struct SourceStats {
  std::vector<std::pair<std::string, dem::SampleCounts>> samples;
  dem::GdalCounts gdal;
};

// Meshes of areas, by the dataset's index: `plan` refuses what is too large, at once and without reading; `build`
// blocks. Both are called on many threads at once.
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
