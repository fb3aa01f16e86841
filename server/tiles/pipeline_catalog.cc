#include "server/tiles/pipeline_catalog.h"

#include <utility>

#include "engine/dem/gdal/gdal_runtime.h"

namespace terrace::server {
namespace {

DatasetView ViewOf(const std::shared_ptr<const tiler::TilePipeline>& pipeline, const tiler::Dataset& dataset) {
  const dem::DemInfo& info = dataset.source->info();
  DatasetView view;
  view.name = dataset.name;
  view.attribution = dataset.attribution;
  view.error_fraction = dataset.error_fraction;
  view.glb_compression = dataset.glb.compression;
  view.generation = dataset.generation;
  view.available = dataset.source->Availability();
  view.west = info.bounds.west;
  view.south = info.bounds.south;
  view.east = info.bounds.east;
  view.north = info.bounds.north;
  view.min_height_m = info.heights.min;
  view.max_height_m = info.heights.max;
  view.range_bound = [pipeline, &source = *dataset.source](const geo::TileKey& key) { return source.RangeBound(key); };
  view.has_datum = dataset.source->has_datum();
  view.sources = info.sources.size();
  view.has_water = dataset.water.any();
  if (dataset.imagery.image) view.texture = dataset.imagery.texture;
  view.metadata_levels = dataset.metadata_levels;
  view.floor_m = info.floor;
  view.max_mercator_depth = info.max_mercator_depth;
  return view;
}

}  // namespace

CatalogPtr MakeCatalog(std::shared_ptr<const tiler::TilePipeline> pipeline, std::size_t max_mesh_samples) {
  auto catalog = std::make_shared<Catalog>();
  for (const tiler::Dataset& dataset : pipeline->datasets()) catalog->datasets.push_back(ViewOf(pipeline, dataset));
  catalog->read_points = [pipeline](std::uint32_t dataset, std::span<const dem::GeoPosition> points,
                                    dem::HeightDatum datum, std::stop_token stop) -> Result<PointHeights> {
    std::vector<std::uint8_t> filled(points.size());
    auto heights = pipeline->datasets()[dataset].source->ReadPoints(points, datum, std::move(stop), filled);
    if (!heights) return tl::unexpected(heights.error());
    PointHeights known(*std::move(heights));
    known.filled = std::move(filled);
    return known;
  };
  catalog->area_mesher.plan = [pipeline, max_mesh_samples](std::uint32_t index, const tiler::AreaRequest& area) {
    const tiler::Dataset& dataset = pipeline->datasets()[index];
    return tiler::PlanArea(*dataset.source, dataset.error_fraction, area, max_mesh_samples);
  };
  catalog->area_mesher.build = [pipeline](std::uint32_t index, const tiler::AreaPlan& plan,
                                          const tiler::AreaRequest& area, std::stop_token stop) {
    return tiler::BuildAreaMesh(*pipeline->datasets()[index].source, plan, area, std::move(stop));
  };
  catalog->source_stats = [pipeline] {
    SourceStats stats;
    stats.gdal = dem::CountGdalErrors();
    for (const tiler::Dataset& dataset : pipeline->datasets()) {
      stats.samples.emplace_back(dataset.name, dataset.source->CountSamples());
    }
    return stats;
  };
  catalog->build = [pipeline = std::move(pipeline)](const tiler::TileRequest& request, std::stop_token stop) {
    return pipeline->Build(request, std::move(stop));
  };
  return catalog;
}

}  // namespace terrace::server
