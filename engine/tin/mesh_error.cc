#include "engine/tin/mesh_error.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/scan/mesh_samples.h"
#include "engine/tin/scan/squared_errors.h"

namespace terrace::tin {

MeshError MeasureError(const HeightField& field, const TinMesh& mesh, std::stop_token stop) {
  std::vector<double> heights;
  heights.reserve(mesh.vertices.size());
  for (const SamplePosition p : mesh.vertices) heights.push_back(static_cast<double>(field.VertexHeight(p.x, p.y)));

  MeshError error;
  std::size_t worst = 0;
  CompensatedSum squares;
  ForEachSample(field, mesh, stop, [&](const MeshSample& sample) {
    const auto& [a, b, c] = sample.triangle;
    const double surface = sample.Interpolate(heights[a], heights[b], heights[c]);
    const double distance = std::abs(surface - static_cast<double>(sample.height));
    ++error.samples;
    squares.Add(distance * distance);
    if (distance > error.max || (distance == error.max && sample.index < worst)) {
      error.max = distance;
      worst = sample.index;
    }
  });
  if (error.samples > 0) error.rms = std::sqrt(squares.Total() / static_cast<double>(error.samples));
  const auto width = static_cast<std::size_t>(field.width());
  error.worst = {static_cast<std::uint16_t>(worst % width), static_cast<std::uint16_t>(worst / width)};
  return error;
}

}  // namespace terrace::tin
