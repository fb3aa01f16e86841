// The samples of a mesh, each with its place in one triangle that covers it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/predicates.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/scan/triangle_rows.h"

namespace terrace::tin {

// A sample of a height field, within a triangle of a mesh.
struct MeshSample {
  const std::array<std::uint32_t, 3>& triangle;  // vertices of the mesh
  int x, y;
  std::size_t index;  // row by row
  float height;
  double weight_b, weight_c, doubled_area;  // of the second and third corner: doubled areas of the opposite triangles

  // The value at the sample of a plane with these values at the corners. It is relative to the first corner's: exact at
  // the corners, without cancellation of large values.
  double Interpolate(double a, double b, double c) const {
    return a + (weight_b * (b - a) + weight_c * (c - a)) / doubled_area;
  }
};

// Calls visit(const MeshSample&) once for each sample that is no void and is covered by a triangle, the first one if
// there are several. Ends early if a stop is requested.
template <typename Visit>
void ForEachSample(const HeightField& field, const TinMesh& mesh, const std::stop_token& stop, Visit&& visit) {
  constexpr std::size_t kStopPeriod = 1024;  // triangles
  const auto width = static_cast<std::size_t>(field.width());
  std::vector<bool> is_visited(width * static_cast<std::size_t>(field.height()));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % kStopPeriod == 0 && stop.stop_requested()) return;
    const auto& triangle = mesh.triangles[t];
    const SamplePosition a = mesh.vertices[triangle[0]], b = mesh.vertices[triangle[1]], c = mesh.vertices[triangle[2]];
    const auto doubled_area = static_cast<double>(Orientation(a, b, c));
    ForEachRow({a, b, c}, [&](int y, int first, int last) {
      for (int x = first; x <= last; ++x) {
        const std::size_t index = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
        const float height = field.At(x, y);
        if (std::isnan(height) || is_visited[index]) continue;
        is_visited[index] = true;
        const SamplePosition p{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
        visit(MeshSample{triangle, x, y, index, height, static_cast<double>(Orientation(c, a, p)),
                         static_cast<double>(Orientation(a, b, p)), doubled_area});
      }
    });
  }
}

}  // namespace terrace::tin
