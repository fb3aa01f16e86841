#include "server/tiles/catalog.h"

#include <algorithm>
#include <utility>

#include "engine/geo/tile_cover.h"
#include "tiler/tile/tile_bounds.h"

namespace terrace::server {
namespace {

// Columns may continue beyond the last one or below 0.
bool Touches(const geo::TileRange& a, const geo::TileRange& b) {
  return !geo::IsEmpty(geo::Intersection({a.start_x - 1, a.start_y - 1, a.end_x + 1, a.end_y + 1}, b));
}

// Extends `box` by the ranges that touch it, around the whole Earth.
geo::TileRange Grown(geo::TileRange box, const std::vector<geo::TileRange>& ranges, std::int64_t columns) {
  constexpr int kMaxPasses = 8;  // ranges are sorted, so further passes would rarely find more
  for (int pass = 0; pass < kMaxPasses; ++pass) {
    const geo::TileRange before = box;
    for (const geo::TileRange& range : ranges) {
      for (const std::int64_t turn : {-columns, std::int64_t{0}, columns}) {
        const geo::TileRange turned{range.start_x + turn, range.start_y, range.end_x + turn, range.end_y};
        if (Touches(box, turned) && box.end_x - box.start_x < columns) box = geo::BoundingRange(box, turned);
      }
    }
    if (box == before) break;
  }
  return box;
}

double WrappedLongitude(double degrees) {
  return degrees > 180 ? degrees - 360 : degrees < -180 ? degrees + 360 : degrees;
}

// A dataset without sources.
void SetExtent(const tiler::Dataset& dataset, DatasetView& view) {
  const tiler::BakedExtent& extent = dataset.baked->extent();
  static_cast<tiler::DatasetExtent&>(view) = extent;
  view.only_archive = dataset.baked;
  view.range_bound = [baked = dataset.baked](const geo::TileKey& key) { return baked->RangeBound(key); };
  view.min_mercator_depth = extent.min_mercator_depth;
  view.max_mercator_depth = extent.max_mercator_depth;
  view.height_tile_bounds = extent.height_tile_bounds;
}

DatasetView ViewOf(const std::shared_ptr<const tiler::TilePipeline>& pipeline, const tiler::Dataset& dataset) {
  DatasetView view;
  view.name = dataset.name;
  view.attribution = dataset.attribution;
  view.error_scale = dataset.error_scale();
  view.glb_compression = dataset.glb.compression;
  view.generation = dataset.generation;
  view.cache_generation = dataset.cache_generation();
  if (dataset.baked) view.baked_coding = dataset.baked->coding();
  if (!dataset.model) {
    SetExtent(dataset, view);
    return view;
  }
  const dem::DemInfo& info = dataset.model->info();
  view.available = dataset.model->Availability();
  view.bounds = info.bounds;
  view.heights = info.heights;
  view.range_bound = [pipeline, &model = *dataset.model](const geo::TileKey& key) -> Result<dem::HeightRange> {
    try {
      return model.RangeBound(key);
    } catch (const ThrownError& thrown) {
      return tl::unexpected(thrown.error());
    }
  };
  if (info.edits > 0) {
    view.edits_hash = [pipeline, &model = *dataset.model](const tiler::TileRequest& request) {
      return tiler::TileEditsHash(model, request);
    };
  }
  view.has_datum = dataset.model->has_datum();
  view.sources = info.sources.size();
  view.has_water = dataset.water.any();
  if (dataset.imagery.image) {
    view.texture = dataset.imagery.texture;
    view.imagery = dataset.imagery.image->extent();
    view.imagery_attribution = dataset.imagery.attribution;
  }
  view.metadata_availability = dataset.metadata_availability;
  view.floor_m = info.floor;
  view.max_mercator_depth = info.max_mercator_depth;
  return view;
}

}  // namespace

CatalogPtr MakeCatalog(std::shared_ptr<const tiler::TilePipeline> pipeline, std::vector<std::string> pending) {
  auto catalog = std::make_shared<Catalog>();
  catalog->pending = std::move(pending);
  for (const tiler::Dataset& dataset : pipeline->datasets()) catalog->datasets.push_back(ViewOf(pipeline, dataset));
  catalog->pipeline = std::move(pipeline);
  return catalog;
}

dem::GeoBounds FinestBounds(const DatasetView& dataset) {
  const dem::GeoBounds& all = dataset.bounds;
  // Levels that edits add have no finer data, and an archive may end above the deepest level of its sources.
  const int level = std::min(dataset.error_scale.max_source_level, dataset.max_level());
  if (level < 0 || dataset.available[static_cast<std::size_t>(level)].empty()) return all;
  const std::vector<geo::TileRange>& ranges = dataset.available[static_cast<std::size_t>(level)];
  const auto size = [](const geo::TileRange& range) {
    return (range.end_x - range.start_x + 1) * (range.end_y - range.start_y + 1);
  };
  const auto largest = std::ranges::max_element(ranges, {}, size);
  const std::int64_t columns = geo::TileColumns(level);
  const geo::TileRange box = Grown(*largest, ranges, columns);
  const double step = 360.0 / static_cast<double>(columns);
  const auto degrees = [step](std::int64_t tiles) { return static_cast<double>(tiles) * step; };
  const double south = std::max(all.south, degrees(box.start_y) - 90);
  const double north = std::min(all.north, degrees(box.end_y + 1) - 90);
  dem::GeoBounds best{degrees(box.start_x) - 180, south, degrees(box.end_x + 1) - 180, north};
  // Clips the outermost tiles to the part with data.
  const double all_east = all.east < all.west ? all.east + 360 : all.east;
  if (box.end_x - box.start_x + 1 >= columns) {
    best.west = all.west;
    best.east = all.east;
  } else if (all_east - all.west < 360) {
    const double west = best.west, east = best.east;
    best.west = best.east = 0;
    for (const double turn : {-360.0, 0.0, 360.0}) {
      const double first = std::max(all.west, west + turn), last = std::min(all_east, east + turn);
      if (last - first <= best.east - best.west) continue;
      best.west = first;
      best.east = last;
    }
  }
  best.west = WrappedLongitude(best.west);
  best.east = WrappedLongitude(best.east);
  return best;
}

bool IsAvailable(const DatasetView& dataset, const geo::TileKey& key) {
  return geo::IsAvailable(dataset.available, key);
}

bool Intersects(const dem::GeoBounds& box, const dem::GeoBounds& tile) {
  if (tile.north < box.south || tile.south > box.north) return false;
  if (box.west > box.east) return tile.west <= box.east || tile.east >= box.west;
  return tile.west <= box.east && tile.east >= box.west;
}

bool IsHeightTileAvailable(const DatasetView& dataset, const geo::TileKey& key, int size) {
  return key.level <= MaxHeightTileLevel(dataset, size) && tiler::IsInScheme(key, /*is_mercator=*/true) &&
         Intersects(dataset.bounds, tiler::TileBounds(key, /*is_mercator=*/true));
}

int MaxHeightTileLevel(const DatasetView& dataset, int size) {
  return dataset.max_mercator_depth - (size == 512 ? 1 : 0);
}

int MinHeightTileLevel(const DatasetView& dataset, int size) {
  return std::max(dataset.min_mercator_depth - (size == 512 ? 1 : 0), 0);
}

}  // namespace terrace::server
