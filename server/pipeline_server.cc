// The server on top of the real tile pipeline; server.cc knows only views and a function.
#include <utility>

#include "server/server.h"
#include "server/tiles/tile_pipeline.h"

namespace terrace::server {
namespace {

DatasetView ViewOf(const Dataset& dataset) {
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
  view.sources = info.sources.size();
  view.has_water = dataset.water.any();
  if (dataset.imagery.image) view.texture = dataset.imagery.texture;
  view.metadata_levels = dataset.metadata_levels;
  view.floor_m = info.floor;
  view.max_mercator_depth = info.max_mercator_depth;
  return view;
}

}  // namespace

Result<std::unique_ptr<Server>> Server::Start(std::shared_ptr<const TilePipeline> pipeline, ServerOptions options) {
  std::vector<DatasetView> views;
  for (const Dataset& dataset : pipeline->datasets()) views.push_back(ViewOf(dataset));
  options.refinement_stats = [pipeline] { return pipeline->refinements(); };
  options.read_points = [pipeline](std::uint32_t dataset, std::span<const dem::GeoPosition> points,
                                   std::stop_token stop) {
    return pipeline->datasets()[dataset].source->ReadPoints(points, std::move(stop));
  };
  options.area_mesher.plan = [pipeline, most = options.max_mesh_samples](std::uint32_t index, const AreaRequest& area) {
    const Dataset& dataset = pipeline->datasets()[index];
    return PlanArea(*dataset.source, dataset.error_fraction, area, most);
  };
  options.area_mesher.build = [pipeline](std::uint32_t index, const AreaPlan& plan, const AreaRequest& area,
                                         std::stop_token stop) {
    return BuildAreaMesh(*pipeline->datasets()[index].source, plan, area, std::move(stop));
  };
  TileBuilder builder = [pipeline = std::move(pipeline)](const TileRequest& request, std::stop_token stop) {
    return pipeline->Build(request, std::move(stop));
  };
  return Start(std::move(views), std::move(builder), std::move(options));
}

}  // namespace terrace::server
