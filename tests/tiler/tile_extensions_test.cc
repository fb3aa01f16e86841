// The extensions of quantized-mesh tiles, built from the shipped global relief and decoded.

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/tiler/fetched_tile.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

const TilePipeline& Earth() {
  static const TilePipeline* const pipeline = [] {
    std::vector<Dataset> datasets;
    for (int i = 0; i < 2; ++i) datasets.push_back(OpenSample("etopo5"));
    datasets[1].water.sea_level_m = 0;
    datasets[1].metadata_availability = 2;
    return new TilePipeline(std::move(datasets));
  }();
  return *pipeline;
}

std::vector<proto::DecodedExtension> ExtensionsOf(std::uint32_t dataset, geo::TileKey key) {
  TileRequest request;
  request.dataset = dataset;
  request.key = key;
  request.extensions.water_mask = request.extensions.metadata = true;
  return FetchTile(Earth(), request).mesh.extensions;
}

// The tile of level 5, 5.625 degrees wide, that contains a position.
geo::TileKey TileAt(double longitude, double latitude) {
  return {5, static_cast<std::int64_t>((longitude + 180) / 5.625), static_cast<std::int64_t>((latitude + 90) / 5.625)};
}
int PixelAt(const std::string& mask, double longitude, double latitude) {
  const geo::TileKey key = TileAt(longitude, latitude);
  const double x = (longitude + 180) / 5.625 - static_cast<double>(key.x);
  const double y = (latitude + 90) / 5.625 - static_cast<double>(key.y);
  return static_cast<unsigned char>(
      mask.at(static_cast<std::size_t>(255 - static_cast<int>(y * 256)) * 256 + static_cast<std::size_t>(x * 256)));
}

TEST(TileExtensions, WaterIsWhereItIsOnEarth) {
  const struct {
    const char* place;
    double longitude, latitude;
    int pixel;
  } places[] = {
      {"Strait of Gibraltar, its Atlantic side", -6.5, 35.8, 255},
      {"Morocco", -5.5, 34.5, 0},
      {"the Channel", -1.0, 50.1, 255},
      {"Normandy", -0.5, 48.9, 0},
      {"Chesapeake's ocean", -74.5, 37.0, 255},
      {"Tasmania", 146.6, -42.0, 0},
      {"the sea west of Tasmania", 144.0, -42.0, 255},
  };
  for (const auto& place : places) {
    const auto extensions = ExtensionsOf(1, TileAt(place.longitude, place.latitude));
    ASSERT_EQ(extensions.size(), 2u) << place.place;
    EXPECT_EQ(extensions[1].id, 2);
    ASSERT_EQ(extensions[1].bytes.size(), 65536u) << place.place;
    EXPECT_EQ(PixelAt(extensions[1].bytes, place.longitude, place.latitude), place.pixel) << place.place;
  }
}

TEST(TileExtensions, OnePixelWhereThereIsNoCoast) {
  EXPECT_EQ(ExtensionsOf(1, TileAt(-150, 0)).at(1).bytes, "\xff") << "the Pacific";
  EXPECT_EQ(ExtensionsOf(1, TileAt(85, 60)).at(1).bytes, std::string(1, '\0')) << "Siberia";
}

TEST(TileExtensions, MetadataTellsWhatIsBelow) {
  const auto extensions = ExtensionsOf(1, {2, 3, 1});
  ASSERT_EQ(extensions.size(), 3u);
  EXPECT_EQ(extensions[2].id, 4);
  const std::string& bytes = extensions[2].bytes;
  EXPECT_EQ(bytes.substr(0, 4), std::string({static_cast<char>(bytes.size() - 4), 0, 0, 0}));
  EXPECT_EQ(nlohmann::json::parse(bytes.substr(4)),
            nlohmann::json::parse(R"({"available":[[{"startX":6,"startY":2,"endX":7,"endY":3}],
                                                  [{"startX":12,"startY":4,"endX":15,"endY":7}]]})"));
  EXPECT_EQ(ExtensionsOf(1, {1, 1, 1}).size(), 2u) << "between two levels that have it";
}

TEST(TileExtensions, ADatasetWithoutThemSendsNone) { EXPECT_EQ(ExtensionsOf(0, {2, 3, 1}).size(), 1u); }

TEST(TileExtensions, DoNotTouchTheMesh) {
  TileRequest request;
  request.dataset = 1;
  request.key = {4, 16, 12};
  const auto plain = Earth().Build(request, {});
  request.extensions.water_mask = request.extensions.metadata = true;
  const auto more = Earth().Build(request, {});
  ASSERT_TRUE(plain.has_value() && more.has_value());
  EXPECT_GT(more->bytes.size(), plain->bytes.size());
  EXPECT_EQ(more->bytes.substr(0, plain->bytes.size()), plain->bytes);
  EXPECT_NE(more->etag, plain->etag);
}

}  // namespace
}  // namespace terrace::tiler
