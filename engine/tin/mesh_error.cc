#include "engine/tin/mesh_error.h"

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/tin/mesh/predicates.h"
#include "engine/tin/scan/squared_errors.h"
#include "engine/tin/scan/triangle_rows.h"

namespace terrace::tin {
namespace {

constexpr std::size_t kErrorStopPeriod = 1024;  // triangles

}  // namespace

MeshError MeasureError(const HeightField& field, const TinMesh& mesh, std::stop_token stop) {
  std::vector<double> heights;
  heights.reserve(mesh.vertices.size());
  for (const SamplePosition p : mesh.vertices) heights.push_back(static_cast<double>(field.VertexHeight(p.x, p.y)));

  const auto width = static_cast<std::size_t>(field.width());
  std::vector<bool> is_measured(width * static_cast<std::size_t>(field.height()));
  MeshError error;
  std::size_t worst = 0;
  CompensatedSum squares;
  const auto measure = [&](std::size_t sample, double distance) {
    if (is_measured[sample]) return;
    is_measured[sample] = true;
    ++error.samples;
    squares.Add(distance * distance);
    if (distance > error.max || (distance == error.max && sample < worst)) {
      error.max = distance;
      worst = sample;
    }
  };

  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    if (t % kErrorStopPeriod == 0 && stop.stop_requested()) break;
    const auto& triangle = mesh.triangles[t];
    const std::array<SamplePosition, 3> corners = {mesh.vertices[triangle[0]], mesh.vertices[triangle[1]],
                                                   mesh.vertices[triangle[2]]};
    const SamplePosition a = corners[0], b = corners[1], c = corners[2];
    const double z_a = heights[triangle[0]], z_b = heights[triangle[1]], z_c = heights[triangle[2]];
    const auto doubled_area = static_cast<double>(Orientation(a, b, c));
    ForEachRow(corners, [&](int y, int first, int last) {
      for (int x = first; x <= last; ++x) {
        const float sample_height = field.At(x, y);
        if (std::isnan(sample_height)) continue;
        const SamplePosition p{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
        // Relative to one corner's height: exact at the corners, without cancellation of large heights.
        const auto weight_b = static_cast<double>(Orientation(c, a, p)),
                   weight_c = static_cast<double>(Orientation(a, b, p));
        const double surface = z_a + (weight_b * (z_b - z_a) + weight_c * (z_c - z_a)) / doubled_area;
        measure(static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x),
                std::abs(surface - static_cast<double>(sample_height)));
      }
    });
  }
  if (error.samples > 0) error.rms = std::sqrt(squares.Total() / static_cast<double>(error.samples));
  error.worst = {static_cast<std::uint16_t>(worst % width), static_cast<std::uint16_t>(worst / width)};
  return error;
}

}  // namespace terrace::tin
