#include "engine/tin/extended/extended_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <tuple>

#include "engine/tin/scan/mesh_samples.h"
#include "engine/tin/scan/squared_errors.h"

namespace terrace::tin {

ExtendedError MeasureExtendedError(const ExtendedField& field, const ColoredMesh& mesh, std::stop_token stop) {
  ExtendedError error;
  error.height = MeasureError(field.heights(), mesh.tin, stop);

  CompensatedSum squares;
  ForEachSample(field.heights(), mesh.tin, stop, [&](const MeshSample& sample) {
    const auto& triangle = sample.triangle;
    double levels = 0;  // of colours, 0 to 255
    if (const Rgba& color = field.ColorAt(sample.x, sample.y); ExtendedField::IsKnown(color)) {
      ++error.color_samples;
      for (std::size_t i = 0; i < std::tuple_size_v<Rgb>; ++i) {
        const auto at = [&](std::size_t corner) { return static_cast<double>(mesh.colors[triangle[corner]][i]); };
        const double distance = std::abs(sample.Interpolate(at(0), at(1), at(2)) - color[i]);
        levels += distance;
        squares.Add(distance * distance);
      }
    }
    const auto height = [&](std::size_t corner) {
      const SamplePosition p = mesh.tin.vertices[triangle[corner]];
      return static_cast<double>(field.heights().VertexHeight(p.x, p.y));
    };
    const double metres =
        std::abs(sample.Interpolate(height(0), height(1), height(2)) - static_cast<double>(sample.height));
    error.max_combined = std::max(error.max_combined, field.Error(metres, levels));
  });
  if (error.color_samples > 0) {
    error.color_rms = std::sqrt(squares.Total() / (3.0 * static_cast<double>(error.color_samples))) / 255;
  }
  return error;
}

}  // namespace terrace::tin
