#include "tests/bench/uniform_grid.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "engine/core/check.h"

namespace terrace::bench {
namespace {

// The sample of a node: evenly spaced, halves rounded up, in integers.
std::uint16_t SampleOf(int node, int nodes, int samples) {
  return static_cast<std::uint16_t>((2 * node * (samples - 1) + nodes - 1) / (2 * (nodes - 1)));
}

}  // namespace

tin::TinMesh UniformGrid(const tin::HeightField& field, int columns, int rows) {
  TERRACE_CHECK(columns >= 2 && columns <= field.width() && rows >= 2 && rows <= field.height());
  tin::TinMesh mesh;
  std::vector<std::uint32_t> vertex_of(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), 0);
  const auto node = [&](int i, int j) { return static_cast<std::size_t>(j * columns + i); };
  const auto add = [&](int i, int j) {
    vertex_of[node(i, j)] = static_cast<std::uint32_t>(mesh.vertices.size());
    mesh.vertices.push_back({SampleOf(i, columns, field.width()), SampleOf(j, rows, field.height())});
  };
  add(0, 0);
  add(columns - 1, 0);
  add(columns - 1, rows - 1);
  add(0, rows - 1);
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      const bool is_corner = (i == 0 || i == columns - 1) && (j == 0 || j == rows - 1);
      if (!is_corner) add(i, j);
    }
  }
  for (int j = 0; j + 1 < rows; ++j) {
    for (int i = 0; i + 1 < columns; ++i) {
      const std::uint32_t a = vertex_of[node(i, j)], b = vertex_of[node(i + 1, j)];
      const std::uint32_t c = vertex_of[node(i + 1, j + 1)], d = vertex_of[node(i, j + 1)];
      mesh.triangles.push_back({a, b, d});
      mesh.triangles.push_back({b, c, d});
    }
  }
  return mesh;
}

tin::TinMesh UniformGridOf(const tin::HeightField& field, std::size_t points) {
  const double shape = static_cast<double>(field.height()) / field.width();
  const auto wanted = static_cast<long>(points);
  int best_columns = 2, best_rows = 2;
  for (int columns = 2; columns <= field.width(); ++columns) {
    const int rows = std::clamp(static_cast<int>(std::lround(columns * shape)), 2, field.height());
    if (std::abs(long{columns} * rows - wanted) < std::abs(long{best_columns} * best_rows - wanted)) {
      best_columns = columns;
      best_rows = rows;
    }
  }
  return UniformGrid(field, best_columns, best_rows);
}

}  // namespace terrace::bench
