#include "tests/tiler/decoded_error.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

namespace terrace::tiler {
namespace {

constexpr std::int64_t kMaxUv = 32767;  // u and v at the eastern and the northern edge
constexpr double kInfinite = std::numeric_limits<double>::infinity();

// In units in which both positions and samples are integers: 1 / (32767 * cells) of the tile.
struct Point {
  std::int64_t x, y;
};

std::int64_t Turn(const Point& a, const Point& b, const Point& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

}  // namespace

std::vector<double> DecodedErrors(const proto::DecodedTile& tile, const dem::TileHeights& heights) {
  const int cells = heights.lattice.cells;
  const double min = static_cast<double>(tile.min_height), max = static_cast<double>(tile.max_height);
  constexpr double kUncovered = -1;
  std::vector<double> errors(static_cast<std::size_t>(cells + 1) * static_cast<std::size_t>(cells + 1), kUncovered);
  for (const auto& triangle : tile.triangles) {
    std::array<Point, 3> p{};
    std::array<double, 3> z{};
    for (std::size_t i = 0; i < 3; ++i) {
      p[i] = {std::int64_t{tile.u[triangle[i]]} * cells, std::int64_t{tile.v[triangle[i]]} * cells};
      z[i] = min + (max - min) * tile.h[triangle[i]] / static_cast<double>(kMaxUv);
    }
    const std::int64_t area = Turn(p[0], p[1], p[2]);
    if (area <= 0) return std::vector<double>(errors.size(), kInfinite);
    const auto [west, east] = std::minmax({p[0].x, p[1].x, p[2].x});
    const auto [south, north] = std::minmax({p[0].y, p[1].y, p[2].y});
    for (std::int64_t j = south / kMaxUv; j * kMaxUv <= north; ++j) {
      for (std::int64_t i = west / kMaxUv; i * kMaxUv <= east; ++i) {
        const Point sample{i * kMaxUv, j * kMaxUv};
        const std::array<std::int64_t, 3> weights = {Turn(p[1], p[2], sample), Turn(p[2], p[0], sample),
                                                     Turn(p[0], p[1], sample)};
        if (*std::min_element(weights.begin(), weights.end()) < 0) continue;
        double height = 0;
        for (std::size_t k = 0; k < 3; ++k) height += z[k] * static_cast<double>(weights[k]);
        const auto truth = static_cast<double>(heights.At(static_cast<int>(i), static_cast<int>(j)));
        double& error = errors[static_cast<std::size_t>(j * (cells + 1) + i)];
        error = std::max(error, std::abs(height / static_cast<double>(area) - truth));
      }
    }
  }
  std::replace(errors.begin(), errors.end(), kUncovered, kInfinite);
  return errors;
}

double DecodedError(const proto::DecodedTile& tile, const dem::TileHeights& heights) {
  return std::ranges::max(DecodedErrors(tile, heights));
}

}  // namespace terrace::tiler
