// Keys of tiles whose metadata lists tiles that edits added.
#include <gtest/gtest.h>

#include <string>

#include "engine/dem/tile_edits.h"
#include "tests/engine/dem/edits_fixture.h"
#include "tiler/tile_pipeline.h"

namespace terrace::tiler {
namespace {

// Precision beside a tile adds tiles in it (mosaic/availability.h), whether or not another edit touches it.
TEST(DeeperKeys, AreOfTheEditsAndOfTheTilesBelow) {
  const dem::TempDir dir;
  const std::string slope = dem::WriteSlope(dir);
  constexpr geo::TileKey kKey{13, 8660, 6386};
  constexpr double kSide = 180.0 / (1 << 13);
  const double west = static_cast<double>(kKey.x) * kSide - 180, south = static_cast<double>(kKey.y) * kSide - 90;
  const auto rectangle = [&](const std::string& terrain, double from) {
    return dem::Rectangle(terrain, west + from * kSide, south + 0.5 * kSide, west + (from + 0.05) * kSide,
                          south + 0.55 * kSide);
  };
  const std::string inside = rectangle(R"({"op":"offset","metres":1})", 0.5);
  const std::string beside = rectangle(R"({"op":"precision","error_m":0.5})", -0.1);
  const auto open = [&](const std::string& features) {
    dem::DemOptions options;
    options.edits = {dem::WriteEdits(dir, features)};
    return dem::OpenOrFail(slope, options);
  };
  const auto offset = open(inside), precise = open(beside), both = open(inside + "," + beside);
  ASSERT_TRUE(offset && precise && both);
  ASSERT_EQ(both->max_source_level(), kKey.level);
  ASSERT_NE(dem::TileEdits(*offset).Hash(kKey), 0u);
  ASSERT_EQ(dem::TileEdits(*both).Hash(kKey), dem::TileEdits(*offset).Hash(kKey));
  ASSERT_EQ(dem::TileEdits(*precise).Hash(kKey), 0u);
  ASSERT_NE(dem::TileEdits(*both).AvailabilityToDepthOf(kKey).size(),
            dem::TileEdits(*offset).AvailabilityToDepthOf(kKey).size());
  TileRequest request;
  request.key = kKey;
  EXPECT_EQ(TileEditsHash(*offset, request), TileEditsHash(*both, request));
  EXPECT_EQ(TileEditsHash(*precise, request), 0u);
  request.extensions.metadata = true;
  EXPECT_EQ(TileEditsHash(*offset, request), dem::TileEdits(*offset).Hash(kKey));
  EXPECT_NE(TileEditsHash(*both, request), TileEditsHash(*offset, request));
  EXPECT_EQ(TileEditsHash(*precise, request), dem::TileEdits(*precise).DeeperTilesHash(kKey));
  EXPECT_NE(TileEditsHash(*both, request), TileEditsHash(*precise, request));
}

}  // namespace
}  // namespace terrace::tiler
