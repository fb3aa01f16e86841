#include "engine/crs/undulations.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>

namespace terrace::dem {
namespace {

std::shared_ptr<const Geoid> Egm96() {
  auto geoid = Geoid::OfCrs("EPSG:5773", {0, 0});
  EXPECT_TRUE(geoid) << geoid.error().message;
  return *geoid;
}

std::shared_ptr<const Undulations> Over(std::shared_ptr<const Geoid> geoid, const Footprint& area) {
  auto undulations = Undulations::Of(std::move(geoid), area);
  EXPECT_TRUE(undulations) << undulations.error().message;
  return undulations ? *std::move(undulations) : nullptr;
}

std::vector<double> At(const Undulations& undulations, const geo::NodeGrid& grid, const NodeWindow& window) {
  auto values = undulations.At(grid, window);
  EXPECT_TRUE(values) << values.error().message;
  return values ? *std::move(values) : std::vector<double>{};
}

// Permitted difference from PROJ in metres; both interpolate between the same nodes.
constexpr double kCloseToProj = 1e-6;

struct Area {
  const char* name;
  Footprint box;
};
const Area kAreas[] = {
    {"Andes", {-71.01, -33.01, -69.99, -31.99}},
    {"across the antimeridian", {159.8, 0, 220.2, 45}},
    {"the Earth", {-180, -90, 180, 90}},
    {"Antarctica", {-180, -90, 180, -60}},
};

TEST(Undulations, AreTheGeoids) {
  const auto geoid = Egm96();
  std::mt19937 random(7);
  for (const auto& [name, box] : kAreas) {
    const auto undulations = Over(geoid, box);
    for (const int level : {0, 2, 4, 6, 9, 13, 18}) {
      const geo::Lattice lattice{level, 256};
      const double longitude = std::uniform_real_distribution(box.west, box.east)(random);
      const double latitude = std::uniform_real_distribution(box.south, box.north)(random);
      const NodeWindow window{
          static_cast<std::int64_t>((longitude + 180) / lattice.StepDegrees()) - 40,
          std::max<std::int64_t>(static_cast<std::int64_t>((latitude + 90) / lattice.StepDegrees()) - 30, -1), 80, 60};
      const std::vector<double> values = At(*undulations, lattice, window);
      int seen = 0;
      for (int i = 0; i < window.columns * window.rows; ++i) {
        const std::int64_t row = window.row + i / window.columns;
        if (row < 0 || row > lattice.rows() || std::isnan(values[i])) continue;
        const bool pole = row == 0 || row == lattice.rows();
        const double exact = geoid->Undulation(
            {pole ? 0 : lattice.Longitude(window.column + i % window.columns), lattice.Latitude(row)});
        ASSERT_NEAR(values[i], exact, kCloseToProj) << name << ", level " << level << ", node " << i;
        ++seen;
      }
      EXPECT_GT(seen, 0) << name << ", level " << level;
    }
  }
}

// Near a pole steps of longitude are short on the ground, so a block of nodes may be bilinear by chance.
TEST(Undulations, NearThePoleAreTheGeoidsAtEveryNode) {
  const auto geoid = Egm96();
  const auto undulations = Over(geoid, {-180, -90, 180, 90});
  const Geoid::Reader exact(*geoid);
  for (int level = 0; level <= 4; ++level) {
    const geo::Lattice lattice{level, 256};
    const auto first = static_cast<std::int64_t>(std::ceil((84 + 90) / lattice.StepDegrees()));
    for (std::int64_t row = first; row < lattice.rows(); ++row) {
      const NodeWindow window{0, row, static_cast<int>(lattice.columns()), 1};
      const auto values = At(*undulations, lattice, window);
      for (std::int64_t column = 0; column < lattice.columns(); ++column) {
        ASSERT_NEAR(values[static_cast<std::size_t>(column)],
                    exact.At({lattice.Longitude(column), lattice.Latitude(row)}), kCloseToProj)
            << "level " << level << ", column " << column << ", row " << row;
      }
    }
  }
}

TEST(Undulations, AreFunctionsOfTheGlobalNode) {
  const auto undulations = Over(Egm96(), {-180, -90, 180, 90});
  const geo::Lattice lattice{7, 64};
  const NodeWindow large{-7, 4000, 90, 70}, small{33, 4021, 20, 15};
  const auto a = At(*undulations, lattice, large), b = At(*undulations, lattice, small);
  const auto turned = At(*undulations, lattice, {small.column + lattice.columns(), small.row, 20, 15});
  for (int row = 0; row < small.rows; ++row) {
    const std::size_t in_large = static_cast<std::size_t>((row + 21) * large.columns + 40);
    const std::size_t in_small = static_cast<std::size_t>(row * small.columns);
    EXPECT_EQ(std::memcmp(&a[in_large], &b[in_small], 20 * sizeof(double)), 0) << row;
    EXPECT_EQ(std::memcmp(&turned[in_small], &b[in_small], 20 * sizeof(double)), 0) << row;
  }
}

TEST(Undulations, OfPoleRowsAreOneValue) {
  const auto undulations = Over(Egm96(), {-180, -90, 180, -60});
  const geo::Lattice lattice{3, 64};
  const auto values = At(*undulations, lattice, {100, -1, 50, 3});
  for (int i = 0; i < 100; ++i) EXPECT_EQ(values[i], values[0]) << i;
  EXPECT_NE(values[100], values[0]);
}

TEST(Undulations, OfWebMercatorPixelsAreTheGeoids) {
  const auto geoid = Egm96();
  const auto undulations = Over(geoid, {-180, -90, 180, 90});
  for (const int depth : {0, 3, 8, 14}) {
    const geo::MercatorGrid grid{depth};
    const NodeWindow window{grid.columns() / 3, grid.rows() / 3, 70, 50};
    const auto values = At(*undulations, grid, window);
    for (int i = 0; i < window.columns * window.rows; ++i) {
      const double exact = geoid->Undulation(
          {grid.Longitude(window.column + i % window.columns), grid.Latitude(window.row + i / window.columns)});
      ASSERT_NEAR(values[i], exact, kCloseToProj) << depth << ": " << i;
    }
  }
}

TEST(Undulations, StayWithinTheRangeOfAnyBoxAndTheRangeIsNarrow) {
  const auto geoid = Egm96();
  std::mt19937 random(11);
  for (const auto& [name, box] : kAreas) {
    const auto undulations = Over(geoid, box);
    for (const int level : {1, 3, 5, 8, 11}) {
      const geo::Lattice lattice{level, 64};
      const double extent = lattice.cells * lattice.StepDegrees();
      const geo::TileKey key{
          level,
          static_cast<std::int64_t>((std::uniform_real_distribution(box.west, box.east)(random) + 180) / extent) %
              geo::TileColumns(level),
          std::min<std::int64_t>(
              static_cast<std::int64_t>((std::uniform_real_distribution(box.south, box.north)(random) + 90) / extent),
              geo::TileRows(level) - 1)};
      const HeightRange range = undulations->RangeOf(lattice.Longitude(lattice.FirstColumn(key)),
                                                     lattice.Latitude(lattice.FirstRow(key)), extent, extent);
      const NodeWindow window{lattice.FirstColumn(key), lattice.FirstRow(key), lattice.cells + 1, lattice.cells + 1};
      double least = 1e9, most = -1e9;
      for (const double value : At(*undulations, lattice, window)) {
        if (std::isnan(value)) continue;
        EXPECT_GE(value, range.min) << name << ", level " << level;
        EXPECT_LE(value, range.max) << name << ", level " << level;
        least = std::min(least, value);
        most = std::max(most, value);
      }
      // A tile is much smaller than the area, and so is the range of its bound, also in the Andes.
      if (level == 11) {
        EXPECT_LT(range.max - range.min, 20) << name;
      }
    }
  }
}

}  // namespace
}  // namespace terrace::dem
