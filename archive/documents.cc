#include "archive/documents.h"

#include <nlohmann/json.hpp>

#include "archive/manifest_json.h"
#include "archive/tile_scheme.h"
#include "proto/documents/layer_json.h"
#include "proto/documents/tile_json.h"
#include "tiler/encoder_version.h"

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
  layer.normals = manifest.kind.normals;
  layer.water_mask = manifest.kind.water_mask;
  if (manifest.kind.metadata) layer.metadata_levels = dataset.metadata_levels;
  return proto::EncodeLayerJson(layer);
}

std::string TileJson(const Manifest& manifest) {
  const BakedDataset& dataset = manifest.dataset;
  proto::TileJsonDescription tiles;
  tiles.name = dataset.name;
  tiles.attribution = dataset.attribution;
  tiles.tile_template = "{z}/{x}/{y}.png?v=" + tiler::VersionText(TilesHash(manifest));
  tiles.max_zoom = manifest.max_level;
  tiles.tile_size = manifest.kind.side_px;
  tiles.encoding = manifest.kind.height_encoding;
  tiles.bounds = dataset.bounds;
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
