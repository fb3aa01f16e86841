// Vector tiles read by protozero's reader, by the field numbers of the specification. tests/e2e/map_layers_test.py and
// tests/examples read tiles by GDAL and by Mapbox's library.
#include "proto/documents/vector_tile.h"

#include <gtest/gtest.h>

#include <protozero/pbf_reader.hpp>
#include <variant>

namespace terrace::proto {
namespace {

struct VectorFeature {
  std::vector<std::uint32_t> tags, geometry;
  int type = 0;
};
struct VectorLayer {
  std::string name;
  std::vector<VectorFeature> features;
  std::vector<std::string> keys;
  std::vector<std::variant<bool, std::int64_t, double>> values;
  std::uint32_t extent = 0, version = 0;
};

VectorLayer ReadVectorTile(const std::string& tile) {
  VectorLayer layer;
  protozero::pbf_reader reader(tile);
  EXPECT_TRUE(reader.next(3));
  protozero::pbf_reader in = reader.get_message();
  EXPECT_FALSE(reader.next()) << "one layer";
  while (in.next()) {
    if (in.tag() == 1)
      layer.name = in.get_string();
    else if (in.tag() == 2) {
      protozero::pbf_reader of = in.get_message();
      VectorFeature& feature = layer.features.emplace_back();
      while (of.next()) {
        if (of.tag() == 3) {
          feature.type = of.get_enum();
          continue;
        }
        std::vector<std::uint32_t>& numbers = of.tag() == 2 ? feature.tags : feature.geometry;
        for (const std::uint32_t number : of.get_packed_uint32()) numbers.push_back(number);
      }
    } else if (in.tag() == 3)
      layer.keys.push_back(in.get_string());
    else if (in.tag() == 4) {
      protozero::pbf_reader value = in.get_message();
      EXPECT_TRUE(value.next());
      if (value.tag() == 7)
        layer.values.emplace_back(value.get_bool());
      else if (value.tag() == 6)
        layer.values.emplace_back(value.get_sint64());
      else if (value.tag() == 3)
        layer.values.emplace_back(value.get_double());
    } else if (in.tag() == 5)
      layer.extent = in.get_uint32();
    else if (in.tag() == 15)
      layer.version = in.get_uint32();
  }
  return layer;
}

// The examples of the specification, sections 4.3.5.3 and 4.3.5.5.
TEST(VectorTile, GeometryIsThatOfTheSpecification) {
  const VectorLayer layer = ReadVectorTile(EncodeContourTile(
      {{100, true, {{{2, 2}, {2, 10}, {10, 10}}}}, {120, false, {{{2, 2}, {2, 10}, {10, 10}}, {{1, 1}, {3, 5}}}}}));
  ASSERT_EQ(layer.features.size(), 2u);
  EXPECT_EQ(layer.features[0].geometry, (std::vector<std::uint32_t>{9, 4, 4, 18, 0, 16, 16, 0}));
  EXPECT_EQ(layer.features[1].geometry, (std::vector<std::uint32_t>{9, 4, 4, 18, 0, 16, 16, 0, 9, 17, 17, 10, 4, 8}));
  for (const VectorFeature& feature : layer.features) EXPECT_EQ(feature.type, 2) << "LINESTRING";
}

TEST(VectorTile, AttributesAreHeightAndIndex) {
  const VectorLayer layer = ReadVectorTile(EncodeContourTile({{-2.5, false, {{{0, 0}, {1, 1}}}},
                                                              {7, false, {}},
                                                              {1000, true, {{{0, 0}, {1, 1}}}},
                                                              {-30, false, {{{-9, 0}, {1, 1}}}}}));
  EXPECT_EQ(layer.name, "contour");
  EXPECT_EQ(layer.extent, 4096u);
  EXPECT_EQ(layer.version, 2u);
  EXPECT_EQ(layer.keys, (std::vector<std::string>{"ele", "index"}));
  ASSERT_EQ(layer.features.size(), 3u) << "without lines there is no feature";
  const auto value = [&](std::size_t feature, std::size_t key) {
    const auto& tags = layer.features[feature].tags;
    EXPECT_EQ(tags.size(), 4u);
    EXPECT_EQ(tags[2 * key], key);
    return layer.values.at(tags[2 * key + 1]);
  };
  EXPECT_EQ(std::get<double>(value(0, 0)), -2.5);
  EXPECT_EQ(std::get<std::int64_t>(value(1, 0)), 1000);
  EXPECT_EQ(std::get<std::int64_t>(value(2, 0)), -30);
  EXPECT_FALSE(std::get<bool>(value(0, 1)));
  EXPECT_TRUE(std::get<bool>(value(1, 1)));
}

TEST(VectorTile, WithoutLinesHasNoBytes) {
  EXPECT_EQ(EncodeContourTile({}), "");
  EXPECT_EQ(EncodeContourTile({{5, false, {}}}), "");
}

}  // namespace
}  // namespace terrace::proto
