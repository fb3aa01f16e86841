#include "proto/documents/vector_tile.h"

#include <cmath>
#include <cstddef>
#include <protozero/pbf_writer.hpp>

namespace terrace::proto {
namespace {

// Field numbers of vector_tile.proto.
constexpr int kTileLayers = 3;
enum LayerField { kName = 1, kFeatures = 2, kKeys = 3, kValues = 4, kExtent = 5, kVersion = 15 };
enum FeatureField { kTags = 2, kType = 3, kGeometry = 4 };
enum ValueField { kDouble = 3, kSint = 6, kBool = 7 };
constexpr int kLineString = 2;

// Section 4.3 of the specification.
enum Command : std::uint32_t { kMoveTo = 1, kLineTo = 2 };
constexpr std::uint32_t CommandOf(Command command, std::size_t count) {
  return static_cast<std::uint32_t>(command) | static_cast<std::uint32_t>(count) << 3;
}

std::vector<std::uint32_t> GeometryOf(const ContourFeature& feature) {
  std::vector<std::uint32_t> geometry;
  TilePoint at;
  const auto add = [&](const TilePoint& to) {
    geometry.push_back(protozero::encode_zigzag32(to.x - at.x));
    geometry.push_back(protozero::encode_zigzag32(to.y - at.y));
    at = to;
  };
  for (const std::vector<TilePoint>& line : feature.lines) {
    geometry.push_back(CommandOf(kMoveTo, 1));
    add(line.front());
    geometry.push_back(CommandOf(kLineTo, line.size() - 1));
    for (std::size_t i = 1; i < line.size(); ++i) add(line[i]);
  }
  return geometry;
}

void PutHeight(protozero::pbf_writer& layer, double height_m) {
  protozero::pbf_writer value(layer, kValues);
  const double whole = std::round(height_m);
  if (whole == height_m) {
    value.add_sint64(kSint, static_cast<std::int64_t>(whole));
  } else {
    value.add_double(kDouble, height_m);
  }
}

}  // namespace

// Values 0 and 1 are "false" and "true"; each feature adds its height.
std::string EncodeContourTile(const std::vector<ContourFeature>& features) {
  std::string tile_bytes;
  std::vector<double> heights;
  protozero::pbf_writer tile(tile_bytes);
  {
    std::string layer_bytes;
    protozero::pbf_writer layer(layer_bytes);
    layer.add_string(kName, kContourLayer.data(), kContourLayer.size());
    for (const ContourFeature& feature : features) {
      if (feature.lines.empty()) continue;
      const std::vector<std::uint32_t> geometry = GeometryOf(feature);
      const std::uint32_t tags[] = {0, static_cast<std::uint32_t>(2 + heights.size()), 1, feature.is_index ? 1u : 0u};
      heights.push_back(feature.height_m);
      protozero::pbf_writer writer(layer, kFeatures);
      writer.add_packed_uint32(kTags, std::begin(tags), std::end(tags));
      writer.add_enum(kType, kLineString);
      writer.add_packed_uint32(kGeometry, geometry.begin(), geometry.end());
    }
    if (heights.empty()) return {};
    layer.add_string(kKeys, "ele");
    layer.add_string(kKeys, "index");
    for (const bool flag : {false, true}) {
      protozero::pbf_writer value(layer, kValues);
      value.add_bool(kBool, flag);
    }
    for (const double height : heights) PutHeight(layer, height);
    layer.add_uint32(kExtent, kVectorTileExtent);
    layer.add_uint32(kVersion, 2);
    tile.add_message(kTileLayers, layer_bytes);
  }
  return tile_bytes;
}

}  // namespace terrace::proto
