#include "archive/manifest_json.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <utility>

#include "archive/unit_name.h"
#include "engine/core/names.h"
#include "engine/core/parse_number.h"
#include "engine/geo/error_ladder.h"
#include "proto/documents/picture_names.h"
#include "proto/gltf/gltf_names.h"
#include "tiler/encoder_version.h"

namespace terrace::archive {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormatMember = "terrace_archive";
constexpr const char* kChecksumMember = "checksum";

// Archives have no tiles in other codings.
constexpr Names<tiler::Coding, 2> kCodingNames = {
    {{"identity", tiler::Coding::kIdentity}, {"gzip", tiler::Coding::kGzip}}};

// Thrown only inside ParseManifest.
struct Wrong : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <typename Table>
auto ValueOf(const Table& names, const Json& json) {
  const auto& text = json.get_ref<const std::string&>();
  const auto value = ValueNamed(names, text);
  if (!value) throw Wrong(fmt::format("'{}' is unknown", text));
  return *value;
}

std::uint64_t HexOf(const Json& json) {
  const auto& text = json.get_ref<const std::string&>();
  const std::optional<std::uint64_t> value = ParseHex16(text);
  if (!value) throw Wrong(fmt::format("'{}' must have 16 hexadecimal digits", text));
  return *value;
}

double NumberOf(const Json& json) {
  if (!json.is_number()) throw Wrong("a number is missing");
  const double value = json.get<double>();
  if (!std::isfinite(value)) throw Wrong("a number is not finite");
  return value;
}

template <typename T>
T WholeOf(const Json& json, T min, T max) {
  if (!json.is_number_integer()) throw Wrong("a whole number is missing");
  const bool is_too_large = json.is_number_unsigned() && json.get<std::uint64_t>() > static_cast<std::uint64_t>(max);
  if (is_too_large) throw Wrong(fmt::format("a number must be {} to {}", min, max));
  if constexpr (std::is_signed_v<T>) {
    if (json.get<std::int64_t>() < min || json.get<std::int64_t>() > max) {
      throw Wrong(fmt::format("a number must be {} to {}", min, max));
    }
  } else if (!json.is_number_unsigned()) {
    throw Wrong("a number must not be negative");
  }
  return json.get<T>();
}
constexpr std::uint64_t kAnyCount = std::uint64_t{1} << 62;

// How JSON is too large; empty: it is not.
std::string BeyondBounds(std::string_view text, std::size_t max_values) {
  constexpr int kMaxDepth = 64;
  std::size_t values = 1;
  int depth = 0;
  bool is_in_string = false, is_escaped = false;
  for (const char c : text) {
    if (is_in_string) {
      is_in_string = is_escaped || c != '"';
      is_escaped = !is_escaped && c == '\\';
      continue;
    }
    is_in_string = c == '"';
    // One of these comes before each value but the first.
    if (c == ',' || c == '[' || c == '{') ++values;
    if (c == '[' || c == '{') ++depth;
    if (c == ']' || c == '}') --depth;
    if (values > max_values) return fmt::format("it has more than {} values", max_values);
    if (depth > kMaxDepth) return fmt::format("it is nested more than {} deep", kMaxDepth);
  }
  return {};
}

// Parses JSON that may be made to harm: a value of two bytes takes fifty in memory, and functions of Json call
// themselves for nested values. Throws Wrong, and what Json::parse throws.
Json ParseBounded(std::string_view text) {
  if (const std::string beyond = BeyondBounds(text, kMaxValues); !beyond.empty()) {
    throw Wrong(beyond + ", which no bake writes; copy it again");
  }
  return Json::parse(text);
}

// Of all members but the checksum, without whitespace: the manifest in the metadata of a single file has other
// whitespace than a file of its own.
std::string ChecksumOf(const Json& others) {
  const std::string text = others.dump(-1, ' ', false, Json::error_handler_t::replace);
  return fmt::format("{:016x}", XXH3_64bits(text.data(), text.size()));
}

Json DatasetJson(const BakedDataset& dataset) {
  const auto& [name, attribution, generation, error_fraction, glb_compression, bounds, heights, floor_m, has_datum,
               metadata_availability, max_level, max_source_level, sources] = dataset;
  Json json;
  json["name"] = name;
  json["attribution"] = attribution;
  json["version"] = tiler::VersionText(generation);
  json["generation"] = fmt::format("{:016x}", generation);
  json["error_fraction"] = error_fraction;
  json["glb_compression"] = NameIn(proto::kGlbCompressionNames, glb_compression);
  json["bounds"] = {bounds.west, bounds.south, bounds.east, bounds.north};
  json["heights"] = {heights.min, heights.max};
  json["floor"] = floor_m;
  json["has_datum"] = has_datum;
  json["metadata_levels"] = metadata_availability;
  json["max_level"] = max_level;
  if (max_source_level != max_level) json["finest_level"] = max_source_level;
  json["sources"] = sources;
  return json;
}

BakedDataset ReadDataset(const Json& json) {
  BakedDataset dataset;
  dataset.name = json.at("name").get<std::string>();
  dataset.attribution = json.at("attribution").get<std::string>();
  dataset.generation = HexOf(json.at("generation"));
  dataset.error_fraction = NumberOf(json.at("error_fraction"));
  if (dataset.error_fraction <= 0) throw Wrong("error_fraction must be above 0");
  dataset.glb_compression = ValueOf(proto::kGlbCompressionNames, json.at("glb_compression"));
  const Json& bounds = json.at("bounds");
  dataset.bounds = {NumberOf(bounds.at(0)), NumberOf(bounds.at(1)), NumberOf(bounds.at(2)), NumberOf(bounds.at(3))};
  dataset.heights = {NumberOf(json.at("heights").at(0)), NumberOf(json.at("heights").at(1))};
  dataset.floor_m = NumberOf(json.at("floor"));
  dataset.has_datum = json.at("has_datum").get<bool>();
  dataset.metadata_availability = WholeOf<int>(json.at("metadata_levels"), 0, geo::kMaxLevel);
  dataset.max_level = WholeOf<int>(json.at("max_level"), 0, geo::kMaxLevel);
  dataset.max_source_level =
      json.contains("finest_level") ? WholeOf<int>(json.at("finest_level"), 0, dataset.max_level) : dataset.max_level;
  dataset.sources = WholeOf<std::uint64_t>(json.at("sources"), 0, kAnyCount);
  return dataset;
}

Json KindJson(const tiler::TileRequest& kind, const std::vector<int>& error_steps) {
  // All members are named, so that a new one fails to compile until it is added here.
  const auto& [dataset, key, error_step, format, compression, texture, coding, extensions, height_encoding, side_px,
               map] = kind;
  const auto& [normals, water_mask, metadata] = extensions;
  static_cast<void>(dataset), static_cast<void>(key), static_cast<void>(error_step);
  static_cast<void>(map);  // archives have no tiles for maps
  Json json;
  json["format"] = NameIn(kFormatNames, format);
  json["coding"] = NameIn(kCodingNames, coding);
  json["octvertexnormals"] = normals;
  json["watermask"] = water_mask;
  json["metadata"] = metadata;
  json["compression"] = NameIn(proto::kGlbCompressionNames, compression);
  json["texture"] = NameIn(proto::kTextureFormatNames, texture);
  json["encoding"] = NameIn(proto::kHeightEncodingNames, height_encoding);
  json["size"] = side_px;
  json["error_steps"] = error_steps;
  return json;
}

void ReadKind(const Json& json, Manifest& manifest) {
  tiler::TileRequest& kind = manifest.kind;
  kind.format = ValueOf(kFormatNames, json.at("format"));
  kind.coding = ValueOf(kCodingNames, json.at("coding"));
  kind.extensions.normals = json.at("octvertexnormals").get<bool>();
  kind.extensions.water_mask = json.at("watermask").get<bool>();
  kind.extensions.metadata = json.at("metadata").get<bool>();
  kind.compression = ValueOf(proto::kGlbCompressionNames, json.at("compression"));
  kind.texture = ValueOf(proto::kTextureFormatNames, json.at("texture"));
  kind.height_encoding = ValueOf(proto::kHeightEncodingNames, json.at("encoding"));
  kind.side_px = WholeOf<int>(json.at("size"), 1, 1 << 16);
  if (std::ranges::find(tiler::kSidesPx, kind.side_px) == tiler::kSidesPx.end()) {
    throw Wrong("size must be 256 or 512");
  }
  for (const Json& step : json.at("error_steps")) {
    manifest.error_steps.push_back(WholeOf<int>(step, geo::kCoarsestStep, geo::kFinestStep));
  }
  if (!manifest.error_steps.empty() &&
      manifest.error_steps.size() != static_cast<std::size_t>(manifest.max_level) + 1) {
    throw Wrong("error_steps must have an entry for each level");
  }
}

Json AvailableJson(const std::vector<std::vector<geo::TileRange>>& available) {
  Json levels = Json::array();
  for (const auto& ranges : available) {
    Json& level = levels.emplace_back(Json::array());
    for (const geo::TileRange& range : ranges)
      level.push_back({range.start_x, range.start_y, range.end_x, range.end_y});
  }
  return levels;
}

void ReadAvailable(const Json& json, Manifest& manifest) {
  const bool is_mercator = tiler::IsMercator(manifest.kind.format);
  for (const Json& ranges : json) {
    const int level = static_cast<int>(manifest.available.size());
    if (level > manifest.max_level) break;
    const std::int64_t rows = geo::TileRows(level), columns = is_mercator ? rows : geo::TileColumns(level);
    auto& of_level = manifest.available.emplace_back();
    for (const Json& range : ranges) {
      const auto number = [&](std::size_t i, std::int64_t end) {
        return WholeOf<std::int64_t>(range.at(i), 0, end - 1);
      };
      of_level.push_back({number(0, columns), number(1, rows), number(2, columns), number(3, rows)});
      if (of_level.back().start_x > of_level.back().end_x || of_level.back().start_y > of_level.back().end_y) {
        throw Wrong("a range of tiles is empty");
      }
    }
  }
  if (manifest.available.size() != static_cast<std::size_t>(manifest.max_level) + 1 ||
      json.size() != manifest.available.size()) {
    throw Wrong("available must have an entry for each level");
  }
  // The trees of a tileset begin there.
  if (manifest.kind.format == tiler::TileFormat::kGlb && manifest.available.front().empty()) {
    throw Wrong("available must have a tile of level 0");
  }
}

UnitEntry ReadUnit(const Json& json) {
  UnitEntry unit;
  unit.name = json.at("name").get<std::string>();
  if (const auto root = UnitRoot(unit.name); !root) throw Wrong(root.error().message);
  unit.key = HexOf(json.at("key"));
  unit.tiles = WholeOf<std::uint64_t>(json.at("tiles"), 0, kAnyCount);
  unit.bytes = WholeOf<std::uint64_t>(json.at("bytes"), 0, kAnyCount);
  unit.xxh3 = json.at("xxh3").get<std::string>();
  return unit;
}

Manifest Read(Json json) {
  const int format = WholeOf<int>(json.at(kFormatMember), 1, 1 << 30);
  if (format > kFormatVersion) {
    throw Wrong(fmt::format("it has format {}, and this program reads formats up to {}; serve it with a newer terrace",
                            format, kFormatVersion));
  }
  if (json.contains(kChecksumMember)) {  // manifests of earlier builds have none
    const std::string stated = json.at(kChecksumMember).get<std::string>();
    json.erase(kChecksumMember);
    if (stated != ChecksumOf(json)) {
      throw Wrong(
          fmt::format("its content does not have the {} that it states, so that it was changed or damaged; copy "
                      "it again, or remove it and run the bake again",
                      kChecksumMember));
    }
  }
  Manifest manifest;
  manifest.product = json.at("product").get<std::string>();
  manifest.encoder = json.at("encoder").get<std::string>();
  manifest.dataset = ReadDataset(json.at("dataset"));
  manifest.max_level = WholeOf<int>(json.at("max_level"), 0, geo::kMaxLevel);
  manifest.min_level = WholeOf<int>(json.at("min_level"), 0, manifest.max_level);
  ReadKind(json.at("tiles"), manifest);
  ReadAvailable(json.at("available"), manifest);
  manifest.identity = json.at("identity").dump();
  std::set<std::string> names;
  for (const Json& unit : json.at("units")) {
    manifest.units.push_back(ReadUnit(unit));
    if (!names.insert(manifest.units.back().name).second) throw Wrong("a unit is named twice");
  }
  return manifest;
}

}  // namespace

std::optional<std::uint64_t> ParseHex16(std::string_view text) {
  constexpr std::size_t kDigits = 16;
  return text.size() == kDigits ? ParseNumber<std::uint64_t>(text, 16) : std::nullopt;
}

std::uint64_t TilesHash(const Manifest& manifest) {
  const Json json = {manifest.dataset.generation, KindJson(manifest.kind, manifest.error_steps),
                     AvailableJson(manifest.available)};
  const std::string text = json.dump();
  return XXH3_64bits(text.data(), text.size());
}

std::string ToJson(const Manifest& manifest) {
  Json json;
  json[kFormatMember] = kFormatVersion;
  json["product"] = manifest.product;
  json["encoder"] = manifest.encoder;
  json["dataset"] = DatasetJson(manifest.dataset);
  json["tiles"] = KindJson(manifest.kind, manifest.error_steps);
  json["min_level"] = manifest.min_level;
  json["max_level"] = manifest.max_level;
  json["available"] = AvailableJson(manifest.available);
  const Json identity = Json::parse(manifest.identity, nullptr, /*allow_exceptions=*/false);
  json["identity"] = identity.is_object() ? identity : Json::object();
  Json& units = json["units"] = Json::array();
  for (const UnitEntry& unit : manifest.units) {
    units.push_back({{"name", unit.name},
                     {"key", fmt::format("{:016x}", unit.key)},
                     {"tiles", unit.tiles},
                     {"bytes", unit.bytes},
                     {"xxh3", unit.xxh3}});
  }
  json[kChecksumMember] = ChecksumOf(json);
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<void> CheckBounds(std::string_view json, std::size_t max_values) {
  const std::string beyond = BeyondBounds(json, max_values);
  if (beyond.empty()) return {};
  return MakeError(ErrorCode::kInvalidArgument, "{}", beyond);
}

Result<Manifest> ParseManifest(std::string_view text) {
  try {
    return Read(ParseBounded(text));
  } catch (const Wrong& wrong) {
    return MakeError(ErrorCode::kInvalidArgument, "the manifest is wrong: {}", wrong.what());
  } catch (const nlohmann::json::exception& exception) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "this is no manifest of an archive ({}); copy it again, or remove it and run the bake again",
                     exception.what());
  }
}

Result<std::string> ManifestIn(std::string_view metadata) {
  try {
    const Json json = ParseBounded(metadata);
    if (json.is_object() && json.contains(kManifestMember)) return json.at(kManifestMember).dump();
  } catch (const Wrong& wrong) {
    return MakeError(ErrorCode::kInvalidArgument, "{}", wrong.what());
  } catch (const nlohmann::json::exception&) {  // it is no JSON
  }
  return MakeError(ErrorCode::kInvalidArgument, "it holds no manifest, so that another program wrote it");
}

}  // namespace terrace::archive
