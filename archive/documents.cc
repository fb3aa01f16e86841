#include "archive/documents.h"

#include <nlohmann/json.hpp>
#include <numeric>
#include <vector>

#include "archive/manifest_json.h"
#include "archive/pmtiles_mapping.h"
#include "engine/dem/planned_tiles.h"
#include "engine/geo/tile_cover.h"
#include "proto/documents/layer_json.h"
#include "proto/documents/tile_json.h"
#include "tiler/encoder_version.h"
#include "tiler/tile/tile_bounds.h"

namespace terrace::archive {
namespace {

using Json = nlohmann::ordered_json;

}  // namespace

std::string LayerJson(const Manifest& manifest) {
  const BakedDataset& dataset = manifest.dataset;
  proto::LayerDescription layer;
  layer.name = dataset.name;
  layer.attribution = dataset.attribution;
  layer.version = tiler::VersionText(TilesHash(manifest));
  layer.available = manifest.available;
  layer.bounds = dataset.bounds;
  layer.normals = manifest.kind.extensions.normals;
  layer.water_mask = manifest.kind.extensions.water_mask;
  if (manifest.kind.extensions.metadata) layer.metadata_availability = dataset.metadata_availability;
  return proto::EncodeLayerJson(layer);
}

dem::GeoBounds HeightTileBounds(const Manifest& manifest) {
  const dem::GeoBounds& data = manifest.dataset.bounds;
  if (manifest.available.empty() || manifest.available.back().empty()) return data;
  const std::vector<geo::TileRange>& deepest = manifest.available.back();
  const geo::TileRange all = std::accumulate(deepest.begin(), deepest.end(), deepest.front(), geo::BoundingRange);
  const int level = static_cast<int>(manifest.available.size()) - 1;
  const auto bounds_of = [&](std::int64_t x, std::int64_t y) {
    return tiler::TileBounds({level, x, y}, /*is_mercator=*/true);
  };
  const dem::GeoBounds north_west = bounds_of(all.start_x, all.start_y), south_east = bounds_of(all.end_x, all.end_y);
  const auto common = dem::CommonBounds(data, {north_west.west, south_east.south, south_east.east, north_west.north});
  if (common.empty()) return data;
  // Two: on both sides of the antimeridian, as the dataset is.
  return common.size() == 1 ? common.front()
                            : dem::GeoBounds{data.west, common.front().south, data.east, common.front().north};
}

std::string TileJson(const Manifest& manifest) {
  const BakedDataset& dataset = manifest.dataset;
  proto::TileJsonDescription tiles;
  tiles.name = dataset.name;
  tiles.attribution = dataset.attribution;
  tiles.tile_template = "{z}/{x}/{y}.png?v=" + tiler::VersionText(TilesHash(manifest));
  tiles.min_zoom = manifest.min_level;
  tiles.max_zoom = manifest.max_level;
  tiles.tile_size = manifest.kind.side_px;
  tiles.encoding = manifest.kind.height_encoding;
  tiles.bounds = HeightTileBounds(manifest);
  return proto::EncodeTileJson(tiles);
}

std::string SingleMetadata(const Manifest& manifest) {
  Json json;
  switch (manifest.kind.format) {
    case tiler::TileFormat::kQuantizedMesh:
      json = Json::parse(LayerJson(manifest));
      break;
    case tiler::TileFormat::kHeightPng:
      json = Json::parse(TileJson(manifest));
      break;
    case tiler::TileFormat::kGlb:
      json["name"] = manifest.dataset.name;
      json["attribution"] = manifest.dataset.attribution;
      json["version"] = tiler::VersionText(TilesHash(manifest));
      json["scheme"] = "tms";
      json["projection"] = "EPSG:4326";
      break;
    default:  // archives have no others
      break;
  }
  json["format"] = FormatName(manifest.kind.format);
  json["media_type"] = MediaTypeOf(manifest.kind.format);
  Manifest alone = manifest;
  alone.units.clear();  // all tiles are in this file
  json[kManifestMember] = Json::parse(ToJson(alone));
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace terrace::archive
