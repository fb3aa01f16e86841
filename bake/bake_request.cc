#include "bake/bake_request.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>

#include "engine/core/plain_number.h"
#include "engine/dem/planned_tiles.h"
#include "engine/geo/mercator_grid.h"
#include "engine/geo/tile_cover.h"
#include "proto/mesh/tile_metadata.h"
#include "tiler/encoder_version.h"

namespace terrace::bake {
namespace {

using Ranges = std::vector<geo::TileRange>;

// Extends ranges to all four children of each parent.
Ranges WithSiblings(Ranges ranges) {
  for (geo::TileRange& range : ranges) {
    range = {range.start_x & ~std::int64_t{1}, range.start_y & ~std::int64_t{1}, range.end_x | 1, range.end_y | 1};
  }
  return geo::Disjoint(std::move(ranges));
}

// The rows of a level of the XYZ scheme that touch south .. north.
std::pair<std::int64_t, std::int64_t> MercatorRows(double south, double north, std::int64_t tiles) {
  const auto edge = [&](std::int64_t row) {
    return geo::MercatorLatitude(static_cast<double>(row) / static_cast<double>(tiles));
  };
  // The first row for which `is_past` holds; it holds for all rows after it.
  const auto first = [&](auto is_past) {
    std::int64_t low = 0, high = tiles;
    while (low < high) {
      const std::int64_t middle = (low + high) / 2;
      is_past(middle) ? high = middle : low = middle + 1;
    }
    return low;
  };
  return {first([&](std::int64_t row) { return edge(row + 1) <= north; }),
          first([&](std::int64_t row) { return edge(row) < south; }) - 1};
}

// Height tiles exist wherever they touch the dataset's bounds (server/tiles/catalog).
Ranges HeightTiles(const dem::GeoBounds& bounds, int level) {
  const std::int64_t tiles = std::int64_t{1} << level;
  const auto rows = MercatorRows(bounds.south, bounds.north, tiles);
  if (rows.first > rows.second) return {};
  const auto column = [&](double degrees) { return (degrees + 180) / 360 * static_cast<double>(tiles); };
  const auto columns = [&](double west, double east) {
    const auto first = static_cast<std::int64_t>(std::ceil(column(west))) - 1;
    const auto last = static_cast<std::int64_t>(std::floor(column(east)));
    return geo::TileRange{std::clamp<std::int64_t>(first, 0, tiles - 1), rows.first,
                          std::clamp<std::int64_t>(last, 0, tiles - 1), rows.second};
  };
  if (bounds.west <= bounds.east) return {columns(bounds.west, bounds.east)};
  return geo::Disjoint({columns(bounds.west, 180), columns(-180, bounds.east)});
}

std::string LevelsTo(int deepest) { return deepest == 0 ? "level 0 only" : fmt::format("levels 0 to {}", deepest); }

Result<tiler::TileRequest> KindOf(const tiler::Dataset& dataset, const BakeRequest& request, tiler::TileFormat format) {
  tiler::TileRequest kind;
  kind.format = format;
  switch (format) {
    case tiler::TileFormat::kQuantizedMesh: {
      const proto::TileExtensions wanted =
          request.extensions.value_or(proto::TileExtensions{true, dataset.water.any(), false});
      if (wanted.water_mask && !dataset.water.any()) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "extension watermask: dataset {} has no water; give it a mask or a sea level with \"water\" in "
            "its configuration",
            dataset.name);
      }
      if (wanted.metadata && dataset.metadata_availability == 0) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "extension metadata: dataset {} has none; set metadata_availability in its configuration",
                         dataset.name);
      }
      if (wanted.metadata && (request.bbox || request.levels)) {
        return MakeError(
            ErrorCode::kInvalidArgument,
            "extension metadata lists the tiles of the whole dataset: leave it out, or bake without --bbox "
            "and --levels");
      }
      kind.extensions = wanted;
      if (request.compress) kind.coding = tiler::Coding::kGzip;
      break;
    }
    case tiler::TileFormat::kGlb:
      kind.compression = dataset.glb.compression;
      if (dataset.imagery.image) kind.texture = dataset.imagery.texture;
      // Draco output is entropy-coded already.
      if (request.compress && kind.compression != proto::GlbCompression::kDraco) kind.coding = tiler::Coding::kGzip;
      break;
    case tiler::TileFormat::kHeightPng:
    default:  // archives have no others
      break;
  }
  return kind;
}

archive::BakedDataset Describe(const tiler::Dataset& dataset) {
  const dem::DemInfo& info = dataset.model->info();
  archive::BakedDataset baked;
  baked.name = dataset.name;
  baked.attribution = dataset.attribution;
  baked.generation = dataset.generation;
  baked.error_fraction = dataset.error_fraction;
  baked.glb_compression = dataset.glb.compression;
  baked.bounds = info.bounds;
  baked.heights = info.heights;
  baked.floor_m = info.floor;
  baked.has_datum = dataset.model->has_datum();
  baked.metadata_availability = dataset.metadata_availability;
  baked.max_level = info.max_level;
  baked.max_source_level = info.max_source_level;
  baked.sources = info.sources.size();
  return baked;
}

}  // namespace

std::vector<Ranges> TilesWithin(const std::vector<Ranges>& available, const dem::GeoBounds& bbox) {
  std::vector<Ranges> levels;
  for (std::size_t level = 0; level < available.size(); ++level) {
    if (level == 0) {
      levels.push_back(available[0]);
      continue;
    }
    const Ranges wanted = WithSiblings(dem::TilesOverlapping(bbox, static_cast<int>(level)));
    Ranges tiles;
    for (const geo::TileRange& range : available[level]) {
      for (const geo::TileRange& part : wanted) {
        const geo::TileRange common = geo::Intersection(range, part);
        if (!geo::IsEmpty(common)) tiles.push_back(common);
      }
    }
    levels.push_back(geo::Disjoint(std::move(tiles)));
  }
  return levels;
}

Result<std::vector<archive::Manifest>> PlanArchives(const tiler::Dataset& dataset, const BakeRequest& request,
                                                    const std::string& product) {
  const dem::ElevationModel& model = *dataset.model;
  const dem::GeoBounds& data = model.info().bounds;
  if (request.bbox && dem::CommonBounds(data, *request.bbox).empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--bbox lies outside dataset {}, which covers {},{},{},{} (west, south, east, north)",
                     dataset.name, PlainNumber(data.west, 4), PlainNumber(data.south, 4), PlainNumber(data.east, 4),
                     PlainNumber(data.north, 4));
  }
  std::vector<archive::Manifest> manifests;
  for (const tiler::TileFormat format : request.formats) {
    const Result<tiler::TileRequest> kind = KindOf(dataset, request, format);
    if (!kind) return tl::unexpected(kind.error());
    archive::Manifest& manifest = manifests.emplace_back();
    manifest.product = product;
    manifest.encoder = tiler::EncoderText();
    manifest.dataset = Describe(dataset);
    manifest.kind = *kind;
    const bool is_mercator = tiler::IsMercator(format);
    const int deepest = is_mercator ? model.info().max_mercator_depth : model.max_level();
    const auto [first, last] = request.levels.value_or(std::pair(0, deepest));
    if (last > deepest) {
      return MakeError(ErrorCode::kInvalidArgument, "--levels {}-{}: dataset {} has {} of {} tiles", first, last,
                       dataset.name, LevelsTo(deepest), archive::FolderOf(format));
    }
    if (first > 0 && !is_mercator) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "--levels {}-{}: clients load a tile only after all tiles above it; bake --levels 0-{}", first,
                       last, last);
    }
    manifest.min_level = first;
    manifest.max_level = last;
    if (is_mercator) {
      const auto areas = request.bbox ? dem::CommonBounds(data, *request.bbox) : std::vector<dem::GeoBounds>{data};
      for (int level = 0; level <= last; ++level) {
        Ranges tiles;
        for (const dem::GeoBounds& area : areas) {
          if (level >= first) std::ranges::copy(HeightTiles(area, level), std::back_inserter(tiles));
        }
        manifest.available.push_back(tiles.empty() ? tiles : geo::Disjoint(std::move(tiles)));
      }
      if (manifest.available.back().empty()) {
        return MakeError(ErrorCode::kInvalidArgument,
                         "--format png: dataset {} has no tiles there: Web Mercator ends at 85.05 degrees of latitude; "
                         "leave png out",
                         dataset.name);
      }
      continue;
    }
    manifest.available = request.bbox ? TilesWithin(model.Availability(), *request.bbox) : model.Availability();
    manifest.available.resize(static_cast<std::size_t>(last) + 1);
    for (int level = 0; level <= last; ++level) {
      manifest.error_steps.push_back(geo::ErrorStep(request.requested, level, dataset.error_scale()));
    }
  }
  return manifests;
}

tiler::TileRequest RequestOf(const archive::Manifest& manifest, const geo::TileKey& key) {
  tiler::TileRequest request = manifest.kind;
  request.key = key;
  if (!manifest.error_steps.empty()) request.error_step = manifest.error_steps[static_cast<std::size_t>(key.level)];
  request.extensions.metadata =
      request.extensions.metadata && proto::CarriesMetadata(key, manifest.dataset.metadata_availability,
                                                            manifest.dataset.max_source_level, manifest.available);
  return request;
}

}  // namespace terrace::bake
