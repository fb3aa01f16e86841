#include "archive/pmtiles_mapping.h"

#include <fmt/format.h>

#include <array>
#include <nlohmann/json.hpp>

#include "archive/manifest.h"
#include "archive/manifest_json.h"
#include "engine/core/names.h"
#include "proto/documents/picture_names.h"
#include "tiler/tile/tile_bounds.h"

namespace terrace::archive {
namespace {

using Json = nlohmann::ordered_json;

}  // namespace

PmtilesKey PmtilesKeyOf(const geo::TileKey& key, bool is_mercator) {
  return {key.level + (is_mercator ? 0 : 1), static_cast<std::uint64_t>(key.x), static_cast<std::uint64_t>(key.y)};
}

std::optional<geo::TileKey> TileKeyOf(std::uint64_t tile_id, bool is_mercator) {
  const std::optional<PmtilesKey> found = KeyOf(tile_id);
  if (!found) return std::nullopt;
  const geo::TileKey key{found->zoom - (is_mercator ? 0 : 1), static_cast<std::int64_t>(found->x),
                         static_cast<std::int64_t>(found->y)};
  if (!tiler::IsInScheme(key, is_mercator)) return std::nullopt;
  return key;
}

Result<PmtilesOptions> PmtilesOptionsOf(const tiler::TileRequest& kind, const std::optional<geo::TileKey>& root) {
  const bool is_mercator = tiler::IsMercator(kind.format);
  PmtilesOptions options;
  if (kind.coding == tiler::Coding::kGzip) {
    options.compression = PmtilesCompression::kGzip;
  } else if (kind.coding != tiler::Coding::kIdentity) {
    return MakeError(ErrorCode::kInvalidArgument, "an archive holds tiles as they are or in gzip, not in {}",
                     tiler::NameOf(kind.coding));
  }
  if (is_mercator) options.type = PmtilesType::kPng;
  if (root) {
    options.bounds = tiler::TileBounds(*root, is_mercator);
  } else if (is_mercator) {
    options.bounds = tiler::TileBounds({0, 0, 0}, is_mercator);
  }
  return options;
}

// Archives have the first three formats.
std::string_view FormatName(tiler::TileFormat format) {
  constexpr std::array<std::string_view, 3> kNames = {"quantized-mesh-1.0", "glb", "png"};
  return kNames.at(static_cast<std::size_t>(format));
}

std::string_view MediaTypeOf(tiler::TileFormat format) {
  constexpr std::array<std::string_view, 3> kTypes = {"application/vnd.quantized-mesh", "model/gltf-binary",
                                                      "image/png"};
  return kTypes.at(static_cast<std::size_t>(format));
}

std::string UnitMetadata(const tiler::TileRequest& kind, std::uint64_t key) {
  const bool is_mercator = tiler::IsMercator(kind.format);
  Json json;
  json["format"] = FormatName(kind.format);
  json["media_type"] = MediaTypeOf(kind.format);
  json["scheme"] = is_mercator ? "xyz" : "tms";
  json["projection"] = is_mercator ? "EPSG:3857" : "EPSG:4326";
  if (is_mercator) json["encoding"] = NameIn(proto::kHeightEncodingNames, kind.height_encoding);
  if (is_mercator) json["tileSize"] = kind.side_px;
  json[kManifestMember] = {{"terrace_archive", kFormatVersion}, {"key", fmt::format("{:016x}", key)}};
  return json.dump();
}

std::optional<std::uint64_t> UnitKeyIn(std::string_view metadata) {
  const Json json = Json::parse(metadata, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return std::nullopt;
  const auto own = json.find(kManifestMember);
  if (own == json.end() || !own->is_object()) return std::nullopt;
  const auto key = own->find("key");
  if (key == own->end() || !key->is_string()) return std::nullopt;
  return ParseHex16(key->get_ref<const std::string&>());
}

}  // namespace terrace::archive
