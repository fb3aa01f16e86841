// Lattices with given heights, and meshes over them, for tests of encoders.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <random>
#include <utility>
#include <vector>

#include "engine/geo/lattice.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/mesh/grid_mesh.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

// Metres by global column (not wrapped) and global row.
using GlobalHeight = std::function<double(std::int64_t column, std::int64_t row)>;

struct GlobalGround {
  geo::TileKey key;
  geo::Lattice lattice;
  std::vector<float> heights;

  GlobalGround(geo::TileKey tile, int cells, const GlobalHeight& height) : key(tile), lattice{tile.level, cells} {
    const std::int64_t columns = lattice.columns(), rows = lattice.rows();
    for (int j = -1; j <= cells + 1; ++j) {
      for (int i = -1; i <= cells + 1; ++i) {
        const std::int64_t column = ((lattice.FirstColumn(tile) + i) % columns + columns) % columns;
        const std::int64_t row = std::clamp<std::int64_t>(lattice.FirstRow(tile) + j, 0, rows);
        const bool pole = row == 0 || row == rows;  // has one height, by the contract of ElevationModel
        heights.push_back(static_cast<float>(std::floor(height(pole ? 0 : column, row) * 1024) / 1024));
      }
    }
  }
  TileSamples view() const { return {key, lattice, heights}; }
};

// Random heights between 0 and `relief`, the same for the same seed.
struct RandomGround {
  geo::TileKey key;
  geo::Lattice lattice;
  std::vector<float> heights;

  RandomGround(geo::TileKey tile, int cells, double relief, unsigned seed) : key{tile}, lattice{tile.level, cells} {
    std::mt19937 random(seed);
    for (int k = 0; k < (cells + 3) * (cells + 3); ++k) {
      heights.push_back(static_cast<float>(relief * static_cast<double>(random() % 4096) / 4096));
    }
    // A pole has one height, by the contract of ElevationModel.
    const std::size_t stride = static_cast<std::size_t>(cells) + 3;
    const std::int64_t south = lattice.FirstRow(tile), north = south + cells;
    if (south == 0) std::fill_n(heights.begin() + static_cast<std::ptrdiff_t>(stride), stride, heights[stride]);
    if (north == lattice.rows()) {
      const std::size_t first = stride * (static_cast<std::size_t>(cells) + 1);
      std::fill_n(heights.begin() + static_cast<std::ptrdiff_t>(first), stride, heights[first]);
    }
  }
  TileSamples view() const { return {key, lattice, heights}; }
};

inline tin::TinMesh GreedyMesh(const TileSamples& samples, const tin::GreedyGoal& goal) {
  const int side = samples.cells() + 1;
  std::vector<float> inside;
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) inside.push_back(samples.At(i, j));
  }
  const auto field = tin::HeightField::Make(side, side, inside);
  tin::GreedyTriangulation triangulation(*field);
  triangulation.Run(goal);
  return triangulation.Mesh();
}

// With the same step everywhere.
inline std::vector<GridPoint> SnapVertices(const TileSamples& samples, const tin::TinMesh& mesh, double step_m) {
  GridSteps steps(samples.lattice, EdgeErrors(1), 1, PositionWidth::kFloat);
  steps.inside = step_m;
  steps.side.fill(step_m);
  steps.corner.fill(step_m);
  return SnapVertices(samples, mesh, steps);
}

// Random heights between 0 and `relief`, the same in every run.
inline GlobalHeight Scattered(double relief) {
  return [relief](std::int64_t column, std::int64_t row) {
    std::uint64_t mixed = static_cast<std::uint64_t>(column) * 0x9e3779b97f4a7c15 + static_cast<std::uint64_t>(row);
    mixed = (mixed ^ (mixed >> 31)) * 0xbf58476d1ce4e5b9;
    return relief * static_cast<double>(mixed >> 40) / 16777216.0;
  };
}

// Every `stride`-th sample, two triangles a cell. The corners are first, as in every TinMesh.
inline tin::TinMesh RegularMesh(int cells, int stride) {
  tin::TinMesh mesh;
  const int side = cells / stride + 1;
  const auto sample = [&](int i, int j) {
    return tin::SamplePosition{static_cast<std::uint16_t>(i * stride), static_cast<std::uint16_t>(j * stride)};
  };
  std::vector<std::uint32_t> number(static_cast<std::size_t>(side * side), 0);
  const auto at = [&](int i, int j) -> std::uint32_t& { return number[static_cast<std::size_t>(j * side + i)]; };
  const int last = side - 1;
  for (const auto& [i, j] : {std::pair(0, 0), std::pair(last, 0), std::pair(last, last), std::pair(0, last)}) {
    at(i, j) = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back(sample(i, j));
  }
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) {
      if ((i == 0 || i == last) && (j == 0 || j == last)) continue;
      at(i, j) = static_cast<std::uint32_t>(mesh.vertices.size());
      mesh.vertices.push_back(sample(i, j));
    }
  }
  for (int j = 0; j < last; ++j) {
    for (int i = 0; i < last; ++i) {
      mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  }
  return mesh;
}

}  // namespace terrace::proto
