#include "proto/mesh/grid_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <vector>

#include "engine/geo/error_ladder.h"
#include "proto/gltf/glb_tile.h"
#include "proto/mesh/skirt.h"
#include "tests/proto/ground.h"

namespace terrace::proto {
namespace {

double TileSide(int level) { return geo::kSemiMajorAxis * geo::ToRadians(180) / std::exp2(level); }

TEST(GridStep, IsAPowerOfTwoWithinItsShareOfTheError) {
  for (int level = 0; level <= geo::kMaxLevel; ++level) {
    for (int step = geo::kCoarsestStep; step <= geo::kFinestStep; ++step) {
      for (const int cells : {32, 256}) {
        const double error = geo::LadderError(level, step), side = TileSide(level);
        for (const PositionWidth width : {PositionWidth::k16Bits, PositionWidth::kFloat}) {
          const double grid = GridStep({level, cells}, error, width);
          EXPECT_EQ(grid, std::exp2(std::round(std::log2(grid))));
          EXPECT_LE(grid, std::max(error / 32, std::exp2(-16)));
          // The largest extent of a tile is its diagonal, and that of the Earth less than twice its semi-major axis.
          EXPECT_LT(std::min(std::sqrt(2.0) * side, 2.0 * geo::kSemiMajorAxis), std::exp2(23) * grid);
        }
      }
    }
    EXPECT_LT(std::sqrt(2.0) * TileSide(level),
              65535 * GridStep({level, 256}, geo::LadderError(level, 0), PositionWidth::k16Bits));
  }
}

// A small error_fraction makes the ladder finer. A step that does not fit would be doubled, but not by the neighbour.
TEST(GridStep, FitsAtTheSmallestErrorFraction) {
  for (int level = 0; level <= geo::kMaxLevel; ++level) {
    const double error = geo::LadderError(level, geo::kFinestStep) / 10;  // error_fraction 0.05 instead of 0.5
    for (const PositionWidth width : {PositionWidth::k16Bits, PositionWidth::kFloat}) {
      const double grid = GridStep({level, 256}, error, width);
      EXPECT_LT(TileSide(level), std::exp2(23) * grid) << level;
      // Edges are refined to 15/16 of the error; rounding takes the rest.
      EXPECT_LE(std::sqrt(3.0) / 2 * grid, std::max(error / 16, std::exp2(-16))) << level;
    }
  }
}

// Rounding moves a point by at most half of a cube's diagonal.
TEST(GridStep, KeepsFloatsWithinACentimetreOfTheBorder) {
  for (int level = 9; level <= geo::kMaxLevel; ++level) {
    for (int step = geo::kCoarsestStep; step <= geo::kFinestStep; ++step) {
      const double grid = GridStep({level, 256}, geo::LadderError(level, step), PositionWidth::kFloat);
      EXPECT_LT(std::sqrt(3.0) / 2 * grid, 0.01) << level;
    }
  }
  EXPECT_EQ(GridStep({8, 256}, geo::LadderError(8, 0), PositionWidth::kFloat), 1.0 / 64);
  EXPECT_EQ(GridStep({2, 256}, geo::LadderError(2, 0), PositionWidth::kFloat), 1);
}

// Neighbours have the same edges unless these have to become coarser than they are.
TEST(GridSteps, DoubleEdgesOnlyWithTheInside) {
  const geo::Lattice lattice{14, 64};
  EdgeErrors errors(2);
  errors.side[1] = errors.corner[1] = errors.corner[2] = 0.1;
  for (const PositionWidth width : {PositionWidth::k16Bits, PositionWidth::kFloat}) {
    const GridSteps before(lattice, errors, 0.01, width);
    GridSteps steps = before;
    ASSERT_LT(steps.inside, before.side[0] / 2);
    for (double inside = 2 * before.inside; inside <= 4 * before.side[0]; inside *= 2) {
      steps.Double();
      EXPECT_EQ(steps.inside, inside);
      for (std::size_t k = 0; k < 4; ++k) {
        EXPECT_EQ(steps.side[k], std::max(before.side[k], inside));
        EXPECT_EQ(steps.corner[k], std::max(before.corner[k], inside));
      }
    }
    // Without limits all steps are one.
    GridSteps plain(lattice, EdgeErrors(2), 2, width);
    plain.Double();
    for (std::size_t k = 0; k < 4; ++k) {
      EXPECT_EQ(plain.inside, 2 * GridStep(lattice, 2, width));
      EXPECT_EQ(plain.side[k], plain.inside);
      EXPECT_EQ(plain.corner[k], plain.inside);
    }
  }
}

// Pairs of neighbours: inside a root, across both roots, across the antimeridian, beside the poles.
struct Meeting {
  geo::TileKey a, b;
  bool east;  // b is east of a, else north
};

std::vector<Meeting> Meetings() {
  std::vector<Meeting> meetings;
  for (const int level : {0, 1, 3, 6, 11, 17, 24}) {
    const std::int64_t columns = geo::TileColumns(level), rows = geo::TileRows(level);
    for (const std::int64_t y : {std::int64_t{0}, rows / 3, rows / 2, rows - 1}) {
      for (const std::int64_t x : {std::int64_t{0}, columns / 2 - 1, columns / 7, columns - 1}) {
        const geo::TileKey key{level, x, y};
        meetings.push_back({key, geo::Neighbour(key, 1, 0), true});
        if (y + 1 < rows) meetings.push_back({key, geo::Neighbour(key, 0, 1), false});
      }
    }
  }
  return meetings;
}

// The points of one edge, by position along it.
std::vector<GridPoint> EdgePoints(const GlobalGround& ground, const tin::TinMesh& mesh, double step, bool vertical,
                                  int fixed) {
  const std::vector<GridPoint> points = SnapVertices(ground.view(), mesh, step);
  std::vector<std::pair<int, GridPoint>> edge;
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto [x, y] = mesh.vertices[k];
    if ((vertical ? x : y) == fixed) edge.emplace_back(vertical ? y : x, points[k]);
  }
  std::sort(edge.begin(), edge.end());
  std::vector<GridPoint> ordered;
  for (const auto& [along, point] : edge) ordered.push_back(point);
  return ordered;
}

TEST(SnapVertices, GivesNeighboursTheSamePoints) {
  for (const int cells : {32, 64}) {
    const tin::TinMesh mesh = RegularMesh(cells, 1);
    for (const Meeting& meeting : Meetings()) {
      const GlobalGround a(meeting.a, cells, Scattered(3000)), b(meeting.b, cells, Scattered(3000));
      for (const int ladder : {geo::kCoarsestStep, -5, 0, 7, geo::kFinestStep}) {
        const double step = GridStep(a.lattice, geo::LadderError(meeting.a.level, ladder), PositionWidth::k16Bits);
        const std::vector<GridPoint> edge = EdgePoints(a, mesh, step, meeting.east, cells);
        EXPECT_EQ(edge.size(), static_cast<std::size_t>(cells) + 1);
        EXPECT_EQ(edge, EdgePoints(b, mesh, step, meeting.east, 0))
            << geo::ToString(meeting.a) << " and " << geo::ToString(meeting.b) << " step " << step;
      }
    }
  }
}

TEST(SnapVertices, StaysWithinHalfAStepOfThePlace) {
  const GlobalGround ground({9, 533, 388}, 32, Scattered(4000));
  const tin::TinMesh mesh = RegularMesh(32, 1);
  const double step = 0.5;
  const std::vector<GridPoint> points = SnapVertices(ground.view(), mesh, step);
  const TileSamples view = ground.view();
  ASSERT_EQ(points.size(), mesh.vertices.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto [x, y] = mesh.vertices[k];
    const geo::Vec3 place = geo::ToEcef(view.Longitude(x), view.Latitude(y), static_cast<double>(view.At(x, y)));
    const geo::Vec3 off = GridPositions({points[k]}, step)[0] - place;
    EXPECT_LE(std::max({std::abs(off.x), std::abs(off.y), std::abs(off.z)}), step / 2 + 1e-6);
  }
}

TEST(SkirtDepth, HoldsBothErrorsAndTheCurvature) {
  for (int level = 0; level <= geo::kMaxLevel; ++level) {
    const double edge = geo::kSemiMajorAxis * geo::ToRadians(180) / std::exp2(level);
    for (int step = geo::kCoarsestStep; step <= geo::kFinestStep; ++step) {
      const double error = geo::LadderError(level, step), depth = SkirtDepth(level, error);
      EXPECT_GE(depth, 3 * error);
      EXPECT_LE(depth, 4 * error);
      EXPECT_GE(depth, 3 * error + std::min(error, edge * edge / (8 * geo::kSemiMajorAxis)));
    }
  }
}

std::vector<geo::Vec3> Upwards(const GlobalGround& ground, const tin::TinMesh& mesh) {
  std::vector<geo::Vec3> normals;
  for (const auto [x, y] : mesh.vertices) {
    normals.push_back(geo::SurfaceNormal(ground.view().Longitude(x), ground.view().Latitude(y)));
  }
  return normals;
}

GridMesh Meshed(const GlobalGround& ground, const tin::TinMesh& mesh, double step, double depth) {
  return MakeGridMesh(ground.view(), mesh, SnapVertices(ground.view(), mesh, step), Upwards(ground, mesh), step, depth);
}

TEST(MakeGridMesh, HangsSkirtsStraightDownFromEveryEdgeVertex) {
  const GlobalGround ground({9, 533, 388}, 32, Scattered(500));
  const tin::TinMesh mesh = RegularMesh(32, 4);
  const double step = 0.25, depth = 300;
  const GridMesh grid = Meshed(ground, mesh, step, depth);
  const std::size_t rim = 4 * 8;
  EXPECT_EQ(grid.positions.size(), mesh.vertices.size() + rim);
  EXPECT_EQ(grid.triangles.size(), mesh.triangles.size() + 2 * rim);

  std::set<GridPoint> points;
  for (const auto& p : grid.positions) {
    points.insert({grid.origin[0] + p[0], grid.origin[1] + p[1], grid.origin[2] + p[2]});
  }
  const TileSamples view = ground.view();
  for (const auto [x, y] : mesh.vertices) {
    if (x != 0 && y != 0 && x != 32 && y != 32) continue;
    const double height = static_cast<double>(view.At(x, y)) - depth;
    const geo::Vec3 foot = geo::ToEcef(view.Longitude(x), view.Latitude(y), height);
    bool found = false;
    for (const GridPoint& p : points) {
      found = found || geo::Length(GridPositions({p}, step)[0] - foot) <= std::sqrt(3.0) * step / 2 + 1e-6;
    }
    EXPECT_TRUE(found) << x << ", " << y;
  }
}

// Skirts face away from the middle of the tile, so a ray from the middle passes through their backs.
TEST(MakeGridMesh, SkirtsFaceOutwards) {
  const GlobalGround ground({9, 533, 388}, 32, Scattered(500));
  const tin::TinMesh mesh = RegularMesh(32, 4);
  const GridMesh grid = Meshed(ground, mesh, 0.25, 300);
  const geo::Vec3 up = geo::SurfaceNormal(ground.view().Longitude(16), ground.view().Latitude(16));
  int walls = 0;
  for (const auto& [a, b, c] : grid.triangles) {
    const auto at = [&](std::uint32_t k) {
      const auto& [x, y, z] = grid.positions[k];
      return geo::Vec3{x * grid.step_m, y * grid.step_m, z * grid.step_m};
    };
    const geo::Vec3 normal = geo::Normalized(geo::Cross(at(b) - at(a), at(c) - at(a)));
    if (std::abs(geo::Dot(normal, up)) > 0.02) continue;  // the ground
    ++walls;
    EXPECT_GT(geo::Dot(normal, at(a)), 0);  // the origin is the middle of the box
  }
  EXPECT_EQ(walls, 64);
}

// The row of a pole is one point; near it whole columns merge.
TEST(MakeGridMesh, IsClosedAtThePoles) {
  for (const int level : {0, 2, 5}) {
    for (const std::int64_t y : {std::int64_t{0}, geo::TileRows(level) - 1}) {
      const GlobalGround ground({level, 1, y}, 32, Scattered(2000));
      const tin::TinMesh mesh = RegularMesh(32, 1);
      const GridMesh grid =
          Meshed(ground, mesh, GridStep(ground.lattice, geo::LadderError(level, 0), PositionWidth::kFloat), 50'000);
      EXPECT_LT(grid.triangles.size(), mesh.triangles.size() + 2 * 128);
      for (const auto& [a, b, c] : grid.triangles) {
        EXPECT_NE(grid.positions[a], grid.positions[b]);
        EXPECT_NE(grid.positions[b], grid.positions[c]);
        EXPECT_NE(grid.positions[c], grid.positions[a]);
      }
      std::set<std::array<std::int32_t, 3>> on_axis;
      for (const auto& p : grid.positions) {
        if (grid.origin[0] + p[0] == 0 && grid.origin[1] + p[1] == 0) on_axis.insert(p);
      }
      EXPECT_EQ(on_axis.size(), level == 0 ? 4u : 2u);  // each pole and the skirt's foot below it
    }
  }
}

// Otherwise a texture is drawn as a fan around the pole.
TEST(MakeGridMesh, APoleHasTheTextureCoordinatesOfEachColumn) {
  const GlobalGround ground({2, 1, geo::TileRows(2) - 1}, 32, Scattered(2000));
  const GridMesh grid =
      Meshed(ground, RegularMesh(32, 1), GridStep(ground.lattice, 100, PositionWidth::kFloat), 50'000);
  int at_pole = 0;
  for (const auto& triangle : grid.triangles) {
    int first = 32, last = 0;
    bool touches = false;
    for (const std::uint32_t k : triangle) {
      const auto [u, v] = grid.uv[k];
      first = std::min<int>(first, u), last = std::max<int>(last, u);
      touches = touches || v == 0;
    }
    if (!touches) continue;
    ++at_pole;
    EXPECT_LE(last - first, 1);
  }
  EXPECT_GE(at_pole, 32);
}

// Beside a pole the first edges of the rim have no length. Clients expect a triangle.
TEST(MakeGridMesh, KeepsATriangleOfTilesInHoles) {
  constexpr int kCells = 32;
  const tin::TinMesh mesh = RegularMesh(kCells, 1);
  for (const geo::TileKey key : {geo::TileKey{3, 5, 0}, geo::TileKey{14, 16394, 14}, geo::TileKey{14, 16394, 16383},
                                 geo::TileKey{14, 16394, 8000}}) {
    const GlobalGround ground(key, kCells, [](std::int64_t, std::int64_t) { return 100; });
    const double error = geo::LadderError(key.level, geo::kCoarsestStep);
    const double step = GridStep(ground.lattice, error, PositionWidth::k16Bits);
    const std::vector<geo::Vec3> up(mesh.vertices.size(), geo::Vec3{0, 0, 1});
    for (const bool all : {true, false}) {  // or all but one, which may have no area
      std::vector<std::uint8_t> left_out(mesh.triangles.size(), 1);
      left_out[0] = all ? 1 : 0;
      const GridMesh grid = MakeGridMesh(ground.view(), mesh, SnapVertices(ground.view(), mesh, step), up, step,
                                         SkirtDepth(key.level, error), left_out);
      ASSERT_FALSE(grid.triangles.empty()) << geo::ToString(key);
      EXPECT_TRUE(EncodeGlb(grid, {}).has_value()) << geo::ToString(key);
      if (!all) continue;
      // No wall: the first corner has another corner within a few steps, its foot.
      double nearest = std::numeric_limits<double>::infinity();
      for (std::size_t k = 1; k < grid.positions.size(); ++k) {
        double squares = 0;
        for (std::size_t axis = 0; axis < 3; ++axis) {
          const double way = static_cast<double>(grid.positions[k][axis] - grid.positions[0][axis]);
          squares += way * way;
        }
        nearest = std::min(nearest, std::sqrt(squares));
      }
      EXPECT_LE(nearest, 4) << geo::ToString(key);
    }
  }
}

}  // namespace
}  // namespace terrace::proto
