#include "engine/tin/extended/extended_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/tin/mesh/predicates.h"
#include "engine/tin/scan/squared_errors.h"
#include "engine/tin/scan/triangle_rows.h"

namespace terrace::tin {
namespace {

constexpr std::size_t kExtendedErrorStopPeriod = 1024;  // triangles

using Surface = std::array<double, 4>;  // z, r, g, b; colours from 0 to 255

Surface SurfaceAt(const ExtendedField& field, SamplePosition p, const Color& color) {
  const auto [red, green, blue] = color;
  return {static_cast<double>(field.heights().VertexHeight(p.x, p.y)), static_cast<double>(red),
          static_cast<double>(green), static_cast<double>(blue)};
}

}  // namespace

ExtendedError MeasureExtendedError(const ExtendedField& field, const ColoredMesh& mesh, std::stop_token stop) {
  ExtendedError error;
  error.height = MeasureError(field.heights(), mesh.tin, stop);

  const auto width = static_cast<std::size_t>(field.width());
  std::vector<bool> is_measured(width * static_cast<std::size_t>(field.height()));
  CompensatedSum squares;
  for (std::size_t t = 0; t < mesh.tin.triangles.size(); ++t) {
    if (t % kExtendedErrorStopPeriod == 0 && stop.stop_requested()) break;
    std::array<SamplePosition, 3> corners;
    std::array<Surface, 3> surfaces;
    for (std::size_t i = 0; i < 3; ++i) {
      const std::uint32_t vertex = mesh.tin.triangles[t][i];
      corners[i] = mesh.tin.vertices[vertex];
      surfaces[i] = SurfaceAt(field, corners[i], mesh.colors[vertex]);
    }
    const SamplePosition a = corners[0], b = corners[1], c = corners[2];
    const auto doubled_area = static_cast<double>(Orientation(a, b, c));
    ForEachRow(corners, [&](int y, int first, int last) {
      for (int x = first; x <= last; ++x) {
        const std::size_t sample = static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x);
        const float height = field.heights().At(x, y);
        if (std::isnan(height) || is_measured[sample]) continue;
        is_measured[sample] = true;
        const SamplePosition p{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
        const auto weight_b = static_cast<double>(Orientation(c, a, p)),
                   weight_c = static_cast<double>(Orientation(a, b, p));
        const auto surface = [&](std::size_t i) {
          const double at_a = surfaces[0][i];
          return at_a + (weight_b * (surfaces[1][i] - at_a) + weight_c * (surfaces[2][i] - at_a)) / doubled_area;
        };
        double levels = 0;
        if (const ColorSample& color = field.ColorAt(x, y); ExtendedField::IsKnown(color)) {
          ++error.color_samples;
          for (std::size_t i = 0; i < 3; ++i) {
            const double distance = std::abs(surface(i + 1) - color[i]);
            levels += distance;
            squares.Add(distance * distance);
          }
        }
        const double metres = std::abs(surface(0) - static_cast<double>(height));
        error.max_combined = std::max(error.max_combined, field.Error(metres, levels));
      }
    });
  }
  if (error.color_samples > 0) {
    error.color_rms = std::sqrt(squares.Total() / (3.0 * static_cast<double>(error.color_samples))) / 255;
  }
  return error;
}

}  // namespace terrace::tin
