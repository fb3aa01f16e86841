#include "tests/engine/tin/rasterizer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace terrace::tin {
namespace {

// floor(a / b), b > 0.
std::int64_t FloorDivide(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }

// The side of a triangle from p to q: positive to its left.
struct Side2D {
  std::int64_t dx, dy, offset;

  Side2D(SamplePosition p, SamplePosition q) : dx(q.x - p.x), dy(q.y - p.y), offset(dy * p.x - dx * p.y) {}

  std::int64_t At(std::int64_t x, std::int64_t y) const { return dx * y - dy * x + offset; }

  // Shortens first..last to the samples of row y that are not to the right of the side.
  void Clip(std::int64_t y, std::int64_t& first, std::int64_t& last) const {
    const std::int64_t at_zero = At(0, y);
    if (dy > 0) last = std::min(last, FloorDivide(at_zero, dy));
    if (dy < 0) first = std::max(first, -FloorDivide(at_zero, -dy));
    if (dy == 0 && at_zero < 0) last = first - 1;
  }

  // Whether a sample on the side is to its left once it is moved by (step_x, step_y) epsilons, the second far smaller.
  bool HoldsMoved(std::int64_t step_x, std::int64_t step_y) const {
    return dy != 0 ? -dy * step_x > 0 : dx * step_y > 0;
  }
};

class Raster {
 public:
  Raster(const HeightField& field, const TinMesh& mesh)
      : field_(field),
        mesh_(mesh),
        times_covered_(static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height())) {}

  Rasterization Run() {
    for (const SamplePosition p : mesh_.vertices) {
      heights_.push_back(field_.VertexHeight(p.x, p.y));
      NoteHeight(heights_.back());
    }
    std::int64_t area = 0;  // doubled
    for (const auto& triangle : mesh_.triangles) area += Cover(triangle);
    result_.has_area_of_field = area == std::int64_t{2} * (field_.width() - 1) * (field_.height() - 1);
    result_.not_once = static_cast<std::size_t>(
        std::count_if(times_covered_.begin(), times_covered_.end(), [](std::uint8_t times) { return times != 1; }));
    CountOpenEdges();
    return result_;
  }

 private:
  void NoteHeight(float height) {
    result_.magnitude = std::max(result_.magnitude, std::abs(static_cast<double>(height)));
  }

  std::int64_t Cover(const std::array<std::uint32_t, 3>& triangle) {
    const SamplePosition a = mesh_.vertices[triangle[0]], b = mesh_.vertices[triangle[1]],
                         c = mesh_.vertices[triangle[2]];
    const std::array<Side2D, 3> opposite = {Side2D(b, c), Side2D(c, a), Side2D(a, b)};  // by corner
    const std::int64_t area = opposite[0].At(a.x, a.y);
    if (area <= 0) {
      ++result_.turned;
      return area;
    }
    for (std::int64_t y = std::min({a.y, b.y, c.y}); y <= std::max({a.y, b.y, c.y}); ++y) {
      std::int64_t first = std::min({a.x, b.x, c.x}), last = std::max({a.x, b.x, c.x});
      for (const Side2D& side : opposite) side.Clip(y, first, last);
      for (std::int64_t x = first; x <= last; ++x) {
        std::array<std::int64_t, 3> weights{};
        for (std::size_t i = 0; i < 3; ++i) weights[i] = opposite[i].At(x, y);
        if (Owns(opposite, weights, x, y)) Measure(triangle, weights, area, static_cast<int>(x), static_cast<int>(y));
      }
    }
    return area;
  }

  bool Owns(const std::array<Side2D, 3>& sides, const std::array<std::int64_t, 3>& weights, std::int64_t x,
            std::int64_t y) const {
    const std::int64_t step_x = x + 1 < field_.width() ? 1 : -1, step_y = y + 1 < field_.height() ? 1 : -1;
    for (std::size_t i = 0; i < 3; ++i) {
      if (weights[i] < 0 || (weights[i] == 0 && !sides[i].HoldsMoved(step_x, step_y))) return false;
    }
    return true;
  }

  void Measure(const std::array<std::uint32_t, 3>& triangle, const std::array<std::int64_t, 3>& weights,
               std::int64_t area, int x, int y) {
    std::uint8_t& times = times_covered_[static_cast<std::size_t>(y) * static_cast<std::size_t>(field_.width()) +
                                         static_cast<std::size_t>(x)];
    times = static_cast<std::uint8_t>(std::min(times + 1, 2));
    const float sample = field_.At(x, y);
    if (std::isnan(sample)) return;
    NoteHeight(sample);
    long double weighted = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      weighted += static_cast<long double>(weights[i]) * static_cast<long double>(heights_[triangle[i]]);
    }
    const auto error =
        static_cast<double>(std::abs(weighted / static_cast<long double>(area) - static_cast<long double>(sample)));
    if (error <= result_.max_error) return;
    result_.max_error = error;
    result_.worst = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
  }

  bool AreOnOneBorder(std::uint32_t u, std::uint32_t v) const {
    const SamplePosition p = mesh_.vertices[u], q = mesh_.vertices[v];
    return (p.x == q.x && (p.x == 0 || p.x == field_.width() - 1)) ||
           (p.y == q.y && (p.y == 0 || p.y == field_.height() - 1));
  }

  // Collects the edges of each smaller vertex as 2 * the larger vertex, plus one for edges from the larger vertex.
  void CountOpenEdges() {
    std::vector<std::size_t> ends(mesh_.vertices.size() + 1);
    const auto for_each_edge = [&](auto&& visit) {
      for (const auto& triangle : mesh_.triangles) {
        for (std::size_t i = 0; i < 3; ++i) {
          const std::uint32_t from = triangle[i], to = triangle[(i + 1) % 3];
          visit(std::min(from, to), std::uint64_t{2} * std::max(from, to) + (from > to ? 1 : 0));
        }
      }
    };
    for_each_edge([&](std::uint32_t smaller, std::uint64_t) { ++ends[smaller + 1]; });
    for (std::size_t v = 1; v < ends.size(); ++v) ends[v] += ends[v - 1];
    std::vector<std::uint64_t> edges(ends.back());
    std::vector<std::size_t> next(ends.begin(), ends.end() - 1);
    for_each_edge([&](std::uint32_t smaller, std::uint64_t edge) { edges[next[smaller]++] = edge; });
    for (std::uint32_t v = 0; v < next.size(); ++v) CountOpenEdgesOf(v, edges.data() + ends[v], edges.data() + next[v]);
  }

  void CountOpenEdgesOf(std::uint32_t vertex, std::uint64_t* begin, std::uint64_t* end) {
    std::sort(begin, end);
    while (begin != end) {
      const std::uint64_t other = *begin / 2;
      const std::uint64_t* const same = begin;
      while (begin != end && *begin / 2 == other) ++begin;
      const auto count = begin - same;
      const bool is_pair = count == 2 && same[0] != same[1];
      const bool is_border = count == 1 && AreOnOneBorder(vertex, static_cast<std::uint32_t>(other));
      if (!is_pair && !is_border) ++result_.open_edges;
    }
  }

  const HeightField& field_;
  const TinMesh& mesh_;
  std::vector<float> heights_;               // by vertex
  std::vector<std::uint8_t> times_covered_;  // by sample: 0, 1, 2 or more
  Rasterization result_;
};

}  // namespace

Rasterization Rasterize(const HeightField& field, const TinMesh& mesh) { return Raster(field, mesh).Run(); }

testing::AssertionResult Keeps(const Rasterization& raster, double bound) {
  if (raster.turned > 0) return testing::AssertionFailure() << raster.turned << " triangles are not counter-clockwise";
  if (raster.not_once > 0) return testing::AssertionFailure() << raster.not_once << " samples are not covered once";
  if (raster.open_edges > 0) return testing::AssertionFailure() << raster.open_edges << " edges are open";
  if (!raster.has_area_of_field) return testing::AssertionFailure() << "the triangles have not the field's area";
  // Interpolation and subtraction round a few times by half a unit in the last place of the largest height.
  const double allowed = bound * (1 + 1e-9) + 0x1p-50 * raster.magnitude;
  if (!(raster.max_error <= allowed)) {
    return testing::AssertionFailure() << "sample " << raster.worst.x << ", " << raster.worst.y << " is "
                                       << raster.max_error << " off, the bound is " << bound;
  }
  return testing::AssertionSuccess();
}

}  // namespace terrace::tin
