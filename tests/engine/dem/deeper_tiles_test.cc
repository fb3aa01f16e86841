// Levels that edits add below those of the sources.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "engine/dem/content_below.h"
#include "engine/dem/elevation_model.h"
#include "engine/dem/tile_edits.h"
#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_cover.h"
#include "tests/engine/dem/edits_fixture.h"

namespace terrace::dem {
namespace {

// Deeper levels exist around the edit alone, with all ancestors and siblings, and lattices become finer on them.
TEST_F(TerrainEdits, GoDeeperWherePrecisionAsksForIt) {
  const auto plain = OpenOrFail(slope_);
  const auto edited = Open(Rectangle(R"({"op":"precision","error_m":0.5,"blend_m":300})", 10.35, 50.35, 10.36, 50.352));
  const auto coarse = Open(Rectangle(R"({"op":"precision","error_m":50})", 10.35, 50.35, 10.36, 50.352));
  ASSERT_TRUE(plain && edited && coarse);
  const int finest = plain->max_level();
  EXPECT_EQ(plain->max_source_level(), finest);
  EXPECT_EQ(coarse->Availability(), plain->Availability());
  EXPECT_EQ(edited->max_source_level(), finest);
  EXPECT_GT(edited->max_level(), finest + 2);
  EXPECT_LE(geo::DefaultError(edited->max_level()), 0.5);
  EXPECT_GT(geo::DefaultError(edited->max_level() - 1), 0.5);
  std::int64_t tiles = 0;
  for (int level = 0; level <= edited->max_level(); ++level) {
    if (level <= finest) {
      EXPECT_EQ(edited->Available(level), plain->Available(level));
      EXPECT_EQ(edited->LatticeOf(level).cells, plain->LatticeOf(level).cells);
    } else {
      EXPECT_EQ(edited->LatticeOf(level).StepDegrees(), edited->LatticeOf(level - 1).StepDegrees() / 2);
    }
    const double side = 180.0 / static_cast<double>(geo::TileRows(level));
    for (const geo::TileRange& range : edited->Available(level)) {
      for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
        for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
          if (level > 0) {
            EXPECT_TRUE(edited->IsAvailable({level - 1, x / 2, y / 2}));
            for (const std::int64_t i : {0, 1, 2, 3})
              EXPECT_TRUE(edited->IsAvailable({level, x / 2 * 2 + i % 2, y / 2 * 2 + i / 2}));
          }
          if (level <= finest) continue;
          ++tiles;
          // On each level a tile around those of the level below, and siblings: no further away than four tiles.
          const double west = static_cast<double>(x) * side - 180, south = static_cast<double>(y) * side - 90;
          EXPECT_TRUE(west + 5 * side > 10.35 && west - 4 * side < 10.36 && south + 5 * side > 50.35 &&
                      south - 4 * side < 50.352);
        }
      }
    }
  }
  EXPECT_GT(tiles, 50);
  // Every tile of the deepest level that meets the polygon exists.
  const int level = edited->max_level();
  const double side = 180.0 / static_cast<double>(geo::TileRows(level));
  for (double latitude = 50.35; latitude < 50.352; latitude += side / 2) {
    for (double longitude = 10.35; longitude < 10.36; longitude += side / 2) {
      EXPECT_TRUE(edited->IsAvailable({level, static_cast<std::int64_t>((longitude + 180) / side),
                                       static_cast<std::int64_t>((latitude + 90) / side)}));
    }
  }
  const geo::TileKey here{finest, static_cast<std::int64_t>((10.355 + 180) / 180 * double(geo::TileRows(finest))),
                          static_cast<std::int64_t>((50.351 + 90) / 180 * double(geo::TileRows(finest)))};
  const geo::TileKey there{finest, here.x - 4, here.y};
  EXPECT_NE(TileEdits(*edited).DeeperTilesHash(here), 0u);
  EXPECT_EQ(TileEdits(*edited).DeeperTilesHash(there), 0u);
  EXPECT_EQ(static_cast<int>(TileEdits(*edited).AvailabilityToDepthOf(here).size()), edited->max_level() + 1);
  EXPECT_EQ(static_cast<int>(TileEdits(*edited).AvailabilityToDepthOf(there).size()), finest + 1);
  EXPECT_EQ(ContentBelow(*plain, there, finest), ContentBelow(*edited, there, finest));
}

// Skirts provide for neighbours of one level of difference, also beside the data.
TEST_F(TerrainEdits, GoDeeperByOneLevelFromTileToTile) {
  const std::string terrain = R"({"op":"precision","error_m":0.5})";
  const auto plain = OpenOrFail(slope_);
  const auto edited = Open(Rectangle(terrain, 10.2, 50.2, 10.201, 50.2005) + "," +
                           Rectangle(terrain, 10.0002, 50.0002, 10.001, 50.001));
  ASSERT_TRUE(plain && edited);
  ASSERT_GT(edited->max_level(), plain->max_level() + 2);
  int checked = 0;
  for (int level = 1; level <= edited->max_level(); ++level) {
    EXPECT_LE(edited->Available(level).size(), 30u);
    for (const geo::TileRange& range : edited->Available(level)) {
      for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
        for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
          if (plain->IsAvailable({level, x, y})) continue;
          for (int around = 0; around < 9; ++around) {
            const geo::TileKey beside = geo::Neighbour({level, x, y}, around % 3 - 1, around / 3 - 1);
            if (!geo::IsValid(beside)) continue;  // beyond a pole
            EXPECT_TRUE(edited->IsAvailable({level - 1, beside.x / 2, beside.y / 2})) << geo::ToString(beside);
            ++checked;
          }
        }
      }
    }
  }
  EXPECT_GT(checked, 900);
}

// Hashes of edits and of deeper tiles are kept apart.
TEST_F(TerrainEdits, HashTheTilesBelowATile) {
  const std::string terrain = R"({"op":"precision","error_m":0.5})";
  const auto plain = OpenOrFail(slope_);
  const auto edited = Open(Rectangle(terrain, 10.2, 50.2, 10.201, 50.2005));
  ASSERT_TRUE(plain && edited);
  int touched = 0, alone = 0;
  for (int level = 0; level <= edited->max_level(); ++level) {
    for (const geo::TileRange& range : edited->Available(level)) {
      for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
        for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
          const geo::TileKey key{level, x, y};
          bool is_deeper = false;
          for (int below = level + 1; below <= edited->max_level() && !is_deeper; ++below) {
            for (const geo::TileRange& of_level : edited->Available(below)) {
              const geo::TileRange common = geo::Intersection(of_level, geo::TilesBelow(key, below));
              is_deeper |= !geo::IsEmpty(common) && !plain->IsAvailable({below, common.start_x, common.start_y});
            }
          }
          const std::uint64_t edits = TileEdits(*edited).Hash(key), deeper = TileEdits(*edited).DeeperTilesHash(key);
          EXPECT_EQ(deeper != 0, is_deeper) << geo::ToString(key);
          EXPECT_EQ(TileEdits(*edited).DeeperTilesHash(key), deeper);
          EXPECT_EQ(TileEdits(*edited).Hash(key), edits);
          if (deeper != 0) {
            EXPECT_NE(deeper, edits);
          }
          ++(is_deeper ? touched : alone);
        }
      }
    }
  }
  EXPECT_GT(touched, 30);
  EXPECT_GT(alone, 30);
}

TEST_F(TerrainEdits, AddNoLevelsAboveTheirFirst) {
  const auto plain = OpenOrFail(slope_);
  ASSERT_NE(plain, nullptr);
  const auto open = [&](int min_level) {
    return Open(Rectangle(fmt::format(R"({{"op":"precision","error_m":1,"min_level":{}}})", min_level), 10.35, 50.35,
                          10.3502, 50.3502));
  };
  int level = plain->max_level();
  while (geo::DefaultError(level) > 1) ++level;
  ASSERT_GT(level, plain->max_level());
  const auto without_effect = open(level + 1), with_effect = open(level);
  ASSERT_TRUE(without_effect && with_effect);
  EXPECT_EQ(without_effect->Availability(), plain->Availability());
  EXPECT_EQ(with_effect->max_level(), level);
}

// Below the sources, an edit beside a square of tiles matters where a deeper tile lies at the rim. Ranges are known by
// blocks of 64 pixels: the next of these in the west is met by the rim's tile of the sources' deepest level alone.
TEST_F(TerrainEdits, AreInTheContentOfTheDeeperTilesThatTheyTouch) {
  constexpr int kFinest = 13;
  constexpr double kTile = 180.0 / (1 << kFinest);
  constexpr geo::TileKey kTop{kFinest - 2, 2165, 1596};
  const double west = static_cast<double>(kTop.x) * 4 * kTile - 180;
  const double middle = (static_cast<double>(kTop.y) + 0.55) * 4 * kTile - 90;
  const double first = west - 0.75 * kTile - 0.192;
  const std::string slope = WriteSlope(dir_, first, "blocks.tif");
  const geo::TileKey coarse{kFinest, kTop.x * 4 - 1, static_cast<std::int64_t>((middle + 90) / kTile)};
  const geo::TileKey fine{kFinest + 1, kTop.x * 8 - 1, static_cast<std::int64_t>((middle + 90) / kTile * 2)};
  const auto open = [&](const std::string& features) {
    DemOptions options;
    if (!features.empty()) options.edits = {WriteEdits(dir_, features)};
    return OpenOrFail(slope, options);
  };
  const auto plain = open("");
  ASSERT_NE(plain, nullptr);
  ASSERT_EQ(plain->max_level(), kFinest);
  const std::string beside = Rectangle(R"({"op":"flatten","height":270})", west - 0.3 * kTile, middle,
                                       west - 0.25 * kTile, middle + 0.02 * kTile);
  const auto precise = [&](double from) {
    return Rectangle(R"({"op":"precision","error_m":1})", from, middle, from + 0.03 * kTile, middle + 0.03 * kTile);
  };
  const auto hash = [&](const std::string& features, bool is_edited) {
    const auto source = open(features);
    if (source == nullptr) return ContentHash{};
    EXPECT_GT(source->max_level(), kFinest + 1);
    EXPECT_EQ(source->RangeBound(coarse).min, plain->RangeBound(coarse).min);
    EXPECT_EQ(source->RangeBound(fine).min < plain->RangeBound(fine).min, is_edited);
    return ContentBelow(*source, kTop, source->max_level());
  };
  const std::string inside = precise(west + 2 * kTile), at_rim = precise(west + 0.2 * kTile);
  EXPECT_EQ(hash(inside, false), hash(inside + "," + beside, true));
  EXPECT_NE(hash(at_rim, false), hash(at_rim + "," + beside, true));
}

// Tiles around the parts alone, not around the Earth.
TEST_F(TerrainEdits, GoDeeperOnBothSidesOfTheAntimeridian) {
  const std::string slope = WriteSlope(dir_, 179.8, "antimeridian.tif");
  const std::string west = "[[[179.99,50.2],[180,50.2],[180,50.202],[179.99,50.202],[179.99,50.2]]]";
  const std::string east = "[[[-180,50.2],[-179.99,50.2],[-179.99,50.202],[-180,50.202],[-180,50.2]]]";
  const auto deeper = [&](const std::string& parts) {
    DemOptions options;
    options.edits = {WriteEdits(
        dir_, fmt::format(R"({{"type":"Feature","properties":{{"terrain":{{"op":"precision","error_m":0.5}}}},)"
                          R"("geometry":{{"type":"MultiPolygon","coordinates":[{}]}}}})",
                          parts))};
    const auto source = OpenOrFail(slope, options);
    std::int64_t tiles = 0;
    for (int level = source->max_source_level() + 1; level <= source->max_level(); ++level) {
      for (const geo::TileRange& range : source->Available(level)) tiles += geo::Cells(range);
    }
    return tiles;
  };
  const std::int64_t one = deeper(west), two = deeper(west + "," + east);
  EXPECT_GT(one, 50);
  EXPECT_GT(two, one * 5 / 4);
  EXPECT_LT(two, one * 9 / 4);
}

TEST_F(TerrainEdits, GoNoDeeperThanSixLevels) {
  const auto edited = Open(Rectangle(R"({"op":"precision","error_m":0.001})", 10.35, 50.35, 10.3502, 50.3502));
  ASSERT_NE(edited, nullptr);
  EXPECT_EQ(edited->max_level(), edited->max_source_level() + 6);
}

}  // namespace
}  // namespace terrace::dem
