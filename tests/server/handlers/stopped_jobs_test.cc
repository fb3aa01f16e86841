// Jobs check their stop token: a stop that is requested in the middle of a job ends it before it has allocated as much
// memory again.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "proto/documents/layer_json.h"
#include "server/documents/document.h"
#include "server/handlers/handlers.h"
#include "tests/server/handlers/allocations.h"
#include "tiler/tileset_documents.h"

namespace terrace::server {
namespace {

// Texts and lists grow by doubling.
constexpr std::size_t kMiddle = std::size_t{256} << 10;

std::vector<DatasetView> Views(std::size_t count) {
  std::vector<DatasetView> views(count);
  for (std::size_t i = 0; i < count; ++i) {
    views[i].name = "dataset" + std::to_string(i);
    views[i].available = {{{0, 0, 1, 0}}};
  }
  return views;
}

TEST(StoppedJobs, LayerJsonEnds) {
  proto::LayerDescription layer;
  layer.available.emplace_back(400'000, geo::TileRange{123'456, 123'456, 123'457, 123'457});
  const StopAtAllocation stop(kMiddle);
  EXPECT_EQ(proto::EncodeLayerJson(layer, stop.token()), "");
  EXPECT_TRUE(stop.happened());
  EXPECT_LE(stop.largest_after(), kMiddle);
}

TEST(StoppedJobs, ListsOfDatasetsEnd) {
  const std::vector<DatasetView> views = Views(10'000);
  {
    const StopAtAllocation stop(kMiddle / 4);
    EXPECT_EQ(DatasetsJson(views, {}, stop.token()), "");
    EXPECT_TRUE(stop.happened());
    EXPECT_LE(stop.largest_after(), kMiddle / 2) << "its tree is taken down with a list of its own";
  }
  const StopAtAllocation stop(kMiddle);
  EXPECT_EQ(IndexHtml(views, {}, stop.token()), "");
  EXPECT_TRUE(stop.happened());
  EXPECT_LE(stop.largest_after(), kMiddle);
}

TEST(StoppedJobs, DocumentsAreNotCompressed) {
  std::stop_source source;
  const auto write = [&](const std::stop_token&) {
    source.request_stop();
    return std::string(std::size_t{8} << 20, 'a');
  };
  const auto made = MakeDocument(write, tiler::Coding::kGzip, source.get_token());
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kCancelled);
}

// The ranges of an archive are read from its files.
TEST(StoppedJobs, SubtreesReadNoFurtherRanges) {
  std::vector<std::vector<geo::TileRange>> available;
  for (int level = 0; level <= 7; ++level) available.push_back({{0, 0, (2 << level) - 1, (1 << level) - 1}});
  tiler::TileTree tree{"", "", available, {-180, -90, 180, 90}, 0.5, 0, {}, {}};
  std::stop_source source;
  int asked = 0;
  tree.range = [&](const geo::TileKey&) {
    if (++asked == 10) source.request_stop();
    return dem::HeightRange{0, 10};
  };
  tree.error_step = [](int) { return 0; };
  tiler::SubtreeOf(tree, {0, 0, 0}, 7, source.get_token());
  EXPECT_EQ(asked, 10);
  tiler::SubtreeOf(tree, {0, 0, 0}, 7, {});
  EXPECT_EQ(asked, 10 + 5461);
}

TEST(StoppedJobs, HeightsEnd) {
  HeightsQuery query;
  query.points.resize(200'000);
  const tiler::PointHeights heights{std::vector<float>(query.points.size(), 1.5F)};
  const StopAtAllocation stop(kMiddle);
  EXPECT_EQ(HeightsJson(query, heights, "maui", nullptr, stop.token()), "");
  EXPECT_TRUE(stop.happened());
  EXPECT_LE(stop.largest_after(), kMiddle);
}

TEST(StoppedJobs, CertifiedPointsEnd) {
  const std::vector<DatasetView> views = Views(1);
  const std::vector<dem::GeoPosition> points(400'000);
  const StopAtAllocation stop(kMiddle);
  const auto tiles = CertifyingTilesOf(views[0], points, 5, stop.token());
  ASSERT_FALSE(tiles);
  EXPECT_EQ(tiles.error().code, ErrorCode::kCancelled);
  EXPECT_TRUE(stop.happened());
  EXPECT_LE(stop.largest_after(), kMiddle);
}

}  // namespace
}  // namespace terrace::server
