#include <gtest/gtest.h>

#include "server/tiles/catalog.h"

namespace terrace::server {
namespace {

// A dataset of the whole Earth with these tiles at level 3, which has 16 columns and 8 rows of 22.5 degrees.
DatasetView Earth(std::vector<geo::TileRange> deepest) {
  DatasetView dataset;
  dataset.available = {{{0, 0, 1, 0}}, {{0, 0, 3, 1}}, {{0, 0, 7, 3}}, std::move(deepest)};
  return dataset;
}

void ExpectBounds(const DatasetView& dataset, const dem::GeoBounds& expected) {
  const dem::GeoBounds bounds = FinestBounds(dataset);
  EXPECT_DOUBLE_EQ(bounds.west, expected.west);
  EXPECT_DOUBLE_EQ(bounds.south, expected.south);
  EXPECT_DOUBLE_EQ(bounds.east, expected.east);
  EXPECT_DOUBLE_EQ(bounds.north, expected.north);
}

TEST(FinestBounds, AreThoseOfTheDeepestTiles) {
  ExpectBounds(Earth({{8, 4, 9, 4}}), {0, 0, 45, 22.5});
  ExpectBounds(Earth({{0, 0, 15, 7}}), {-180, -90, 180, 90});
  DatasetView none;
  ExpectBounds(none, {-180, -90, 180, 90});
}

TEST(FinestBounds, HoldWhatTouchesTheLargestRangeAlone) {
  ExpectBounds(Earth({{1, 1, 1, 1}, {8, 4, 9, 4}, {9, 5, 10, 5}, {13, 4, 13, 4}}), {0, 0, 67.5, 45});
  ExpectBounds(Earth({{6, 3, 6, 3}, {7, 4, 7, 4}, {8, 5, 9, 5}}), {-45, -22.5, 45, 45});
}

TEST(FinestBounds, CrossTheAntimeridian) {
  ExpectBounds(Earth({{0, 4, 1, 4}, {14, 4, 15, 4}}), {135, 0, -135, 22.5});
  ExpectBounds(Earth({{0, 4, 15, 4}}), {-180, 0, 180, 22.5});
}

TEST(FinestBounds, LieWithinTheData) {
  DatasetView dataset = Earth({{8, 4, 8, 4}});
  dataset.bounds = {5, 4, 6, 7};
  ExpectBounds(dataset, {5, 4, 6, 7});
  dataset = Earth({{0, 4, 0, 4}, {15, 4, 15, 4}});
  dataset.bounds = {179, 4, -178, 7};
  ExpectBounds(dataset, {179, 4, -178, 7});
}

}  // namespace
}  // namespace terrace::server
