#include "engine/edits/read_edits.h"

#include <fmt/format.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <nlohmann/json.hpp>
#include <span>
#include <stdexcept>
#include <utility>

#include "engine/edits/edit_properties.h"
#include "engine/edits/parse_edit.h"

namespace terrace::dem {
namespace {

// Deeper values are refused: GeoJSON needs 9 levels, and the parser's values are written recursively.
constexpr int kMaxNesting = 64;

// Messages quote the file, and what they quote may be as long as the file.
std::string Shortened(const std::string& message) {
  constexpr std::size_t kMaxBytes = 500;
  if (message.size() <= kMaxBytes) return message;
  std::size_t size = kMaxBytes;
  while ((static_cast<unsigned char>(message[size]) & 0xC0) == 0x80) --size;  // between characters of UTF-8
  return message.substr(0, size) + " ...";
}

}  // namespace

std::string EditFault::Text() const {
  std::string text = file;
  if (feature) text += fmt::format(": feature {}", *feature);
  if (place) text += fmt::format(" at {:.6f}, {:.6f} (lat, lon)", place->latitude, place->longitude);
  return text + ": " + Shortened(message);
}

std::string TextOf(const std::vector<EditFault>& faults) {
  constexpr std::size_t kMaxFaults = 20;
  std::string text;
  for (std::size_t i = 0; i < std::min(faults.size(), kMaxFaults); ++i) text += (i > 0 ? "\n" : "") + faults[i].Text();
  if (faults.size() > kMaxFaults) text += fmt::format("\nand {} more", faults.size() - kMaxFaults);
  return text;
}

namespace {

// The member "terrain" of a collection: {"vertical": ...} for all features that do not state their own.
void ReadCommon(const nlohmann::json& common, const std::string& path, std::span<Edit> edits,
                std::vector<EditFault>& faults) {
  const auto fail = [&](std::string message) { faults.push_back({path, {}, {}, std::move(message)}); };
  if (!common.is_object()) return fail(R"(its "terrain" must be an object, such as {"vertical": "orthometric"})");
  for (const auto& [key, value] : common.items()) {
    if (key != "vertical") {
      fail(fmt::format("unknown member \"{}\" of its \"terrain\"; it may have \"vertical\"", key));
      continue;
    }
    const auto datum = ParseDatum(value);
    if (!datum) {
      fail(datum.error());
      continue;
    }
    for (Edit& edit : edits) {
      if (edit.has_heights() && edit.datum == EditDatum::kNone) edit.datum = *datum;
    }
  }
}

}  // namespace

void ReadEdits(const std::string& path, std::vector<Edit>& edits, std::vector<EditFault>& faults) {
  using nlohmann::json;
  std::ifstream stream(path, std::ios::binary);
  if (!stream) {
    faults.push_back({path, {}, {}, "cannot be read; name a GeoJSON file"});
    return;
  }
  std::size_t features = 0;
  const std::size_t first = edits.size();
  bool is_features = false, in_features = false, has_features = false;  // the key, its list, any list
  const auto take = [&](const json& feature) {
    if (auto edit = ParseEdit(feature, path, features, faults)) edits.push_back(*std::move(edit));
    ++features;
  };
  // The features of a collection are parsed one by one, and not kept.
  const json::parser_callback_t each = [&](int depth, json::parse_event_t event, json& value) {
    using Event = json::parse_event_t;
    if (depth > kMaxNesting) throw std::length_error(fmt::format("values are nested deeper than {}", kMaxNesting));
    if (event == Event::key && depth == 1) {
      is_features = value == "features";
      in_features = false;
    }
    if (event == Event::array_start && depth == 1) {
      in_features = is_features;
      has_features |= is_features;
    }
    if (in_features && depth == 2 && (event == Event::value || event == Event::array_start)) {
      faults.push_back({path, features, {}, "is no object of the type \"Feature\""});
      ++features;
    }
    if (event == Event::object_end && depth == 2 && in_features) {
      take(value);
      return false;
    }
    return true;
  };
  try {
    const json root = json::parse(stream, each);
    const bool is_object = root.is_object();
    const std::string type = is_object && root.contains("type") && root["type"].is_string() ? root["type"] : "";
    if (type == "Feature") {
      take(root);
    } else if (type != "FeatureCollection" || !has_features) {
      faults.push_back({path, {}, {}, "is no GeoJSON FeatureCollection; edits are its features (RFC 7946)"});
    }
    if (is_object && root.contains("terrain"))
      ReadCommon(root["terrain"], path, std::span(edits).subspan(first), faults);
    if (is_object && root.contains("crs")) {
      const std::string crs = root["crs"].dump();
      if (crs.find("CRS84") == std::string::npos && crs.find("4326") == std::string::npos) {
        faults.push_back({path,
                          {},
                          {},
                          "names a reference system; GeoJSON has longitude and latitude of WGS 84: "
                          "convert it with ogr2ogr -t_srs EPSG:4326"});
      }
    }
  } catch (const std::exception& error) {
    std::string what = error.what();  // quotes the file, which may be no text
    std::ranges::replace_if(
        what, [](char c) { return static_cast<unsigned char>(c) >= 0x80; }, '?');
    faults.push_back({path, {}, {}, fmt::format("is no JSON: {}", what)});
  }
}

}  // namespace terrace::dem
