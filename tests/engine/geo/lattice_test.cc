#include "engine/geo/lattice.h"

#include <gtest/gtest.h>

namespace terrace::geo {
namespace {

TEST(Lattice, CountsSamplesFromTheSouthWest) {
  const Lattice lattice{0, 256};
  EXPECT_EQ(lattice.columns(), 512);
  EXPECT_EQ(lattice.rows(), 256);
  EXPECT_EQ(lattice.StepDegrees(), 180.0 / 256);
  EXPECT_EQ(lattice.Longitude(0), -180);
  EXPECT_EQ(lattice.Longitude(256), 0);
  EXPECT_EQ(lattice.Latitude(0), -90);
  EXPECT_EQ(lattice.Latitude(128), 0);
  EXPECT_EQ(lattice.Latitude(256), 90);
}

TEST(Lattice, WrapsColumnsAndClampsRows) {
  for (const int level : {0, 7, kMaxLevel}) {
    const Lattice lattice{level, 64};
    EXPECT_EQ(lattice.Longitude(lattice.columns()), -180);
    EXPECT_EQ(lattice.Longitude(-1), lattice.Longitude(lattice.columns() - 1));
    EXPECT_EQ(lattice.Latitude(-1), -90);
    EXPECT_EQ(lattice.Latitude(lattice.rows() + 1), 90);
  }
}

TEST(Lattice, GivesNeighboursTheSameSharedColumnAndRow) {
  for (const int cells : {32, 64, 128, 256}) {
    for (const int level : {0, 3, 14, kMaxLevel}) {
      const Lattice lattice{level, cells};
      const TileKey key{level, TileColumns(level) - 1, TileRows(level) / 2};
      const std::int64_t east_edge = lattice.FirstColumn(key) + cells;
      EXPECT_EQ(lattice.Longitude(east_edge), lattice.Longitude(lattice.FirstColumn(Neighbour(key, 1, 0))));
      EXPECT_EQ(lattice.FirstRow(key) + cells, lattice.FirstRow(Neighbour(key, 0, 1)));
    }
  }
}

TEST(Lattice, NodesOfALevelAreNodesOfTheNext) {
  const Lattice coarse{5, 256}, fine{6, 256};
  for (std::int64_t i = 0; i < coarse.rows(); i += 37) {
    EXPECT_EQ(coarse.Latitude(i), fine.Latitude(2 * i));
    EXPECT_EQ(coarse.Longitude(i), fine.Longitude(2 * i));
  }
}

}  // namespace
}  // namespace terrace::geo
