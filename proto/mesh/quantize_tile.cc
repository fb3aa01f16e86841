#include "proto/mesh/quantize_tile.h"

#include <algorithm>
#include <cmath>

#include "engine/core/check.h"

namespace terrace::proto {
namespace {

bool IsFloat(double value) { return static_cast<double>(static_cast<float>(value)) == value; }

struct HeightScale {
  double min = 0;
  double step = 0;  // 0: all heights are equal
};

// The smallest power of two for which 32767 steps, from a multiple of it, cover [low, high], and whose multiples are
// exact in float32.
HeightScale ChooseScale(double low, double high) {
  if (low == high) return {low, 0};
  double step = std::ldexp(1.0, std::ilogb((high - low) / kQuantizedMax));
  for (;; step *= 2) {
    const double min = std::floor(low / step) * step;
    const double max = min + kQuantizedMax * step;
    if (SnapHeight(high, step) <= max && IsFloat(min) && IsFloat(max)) return {min, step};
  }
}

}  // namespace

QuantizedTile QuantizeTile(const TileSamples& samples, const tin::TinMesh& mesh, const EdgeSteps& steps) {
  const int cells = samples.cells();
  std::vector<double> heights;
  heights.reserve(mesh.vertices.size());
  for (const tin::SamplePosition p : mesh.vertices) {
    const double height = samples.At(p.x, p.y), step = StepAt(steps, p.x, p.y, cells);
    heights.push_back(step > 0 ? SnapHeight(height, step) : height);
  }
  const auto [low, high] = std::minmax_element(heights.begin(), heights.end());
  const HeightScale scale = ChooseScale(*low, *high);

  QuantizedTile tile;
  tile.key = samples.key;
  tile.min_height = static_cast<float>(scale.min);
  tile.max_height = static_cast<float>(scale.min + kQuantizedMax * scale.step);
  tile.triangles = mesh.triangles;
  tile.u.reserve(heights.size());
  tile.v.reserve(heights.size());
  tile.h.reserve(heights.size());
  for (std::size_t k = 0; k < heights.size(); ++k) {
    const double units = scale.step > 0 ? (heights[k] - scale.min) / scale.step + 0.5 : 0;
    TERRACE_CHECK(units >= 0 && units < kQuantizedMax + 1);  // so the cast is its floor
    tile.u.push_back(QuantizedPosition(mesh.vertices[k].x, cells));
    tile.v.push_back(QuantizedPosition(mesh.vertices[k].y, cells));
    tile.h.push_back(static_cast<std::uint16_t>(units));
  }
  return tile;
}

}  // namespace terrace::proto
