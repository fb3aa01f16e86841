#include "engine/edits/edit_shape.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "engine/geo/ellipsoid.h"

namespace terrace::dem {
namespace {

double Cross(PlanPoint a, PlanPoint b, PlanPoint c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }

double Sign(const std::vector<PlanPoint>& ring) {
  double area = 0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const PlanPoint a = ring[i], b = ring[(i + 1) % ring.size()];
    area += a.x * b.y - b.x * a.y;
  }
  return area < 0 ? -1 : 1;
}

bool IsConvex(const std::vector<PlanPoint>& ring) {
  const double sign = Sign(ring);
  for (std::size_t i = 0; i < ring.size(); ++i) {
    if (sign * Cross(ring[i], ring[(i + 1) % ring.size()], ring[(i + 2) % ring.size()]) < 0) return false;
  }
  return true;
}

// The height of a point in the plane through a triangle's corners, and the gradient.
std::array<double, 3> PlaneThrough(PlanPoint a, PlanPoint b, PlanPoint c, double ha, double hb, double hc) {
  const double area = Cross(a, b, c), d1 = hb - ha, d2 = hc - ha;
  const double gx = (d1 * (c.y - a.y) - d2 * (b.y - a.y)) / area;
  const double gy = (d2 * (b.x - a.x) - d1 * (c.x - a.x)) / area;
  return {gx, gy, ha - gx * a.x - gy * a.y};
}

std::size_t EdgesOf(const Edit& edit, std::size_t ring) { return edit.rings[ring].size() - (edit.is_area ? 0 : 1); }

// Does not decrease with y, so that an edge's bands contain the band of every y between its ends.
std::size_t BandOf(const Edit& edit, double y, std::size_t bands) {
  const double band = std::floor((y - edit.bands_from) * edit.bands_per_m);
  return static_cast<std::size_t>(std::clamp(band, 0.0, static_cast<double>(bands - 1)));
}

}  // namespace

double EditPlane::X(double lon) const { return std::remainder(lon - longitude, 360.0) * east_m; }

EditRow::EditRow(const Edit& edit, double y, double margin_m)
    : edit_(edit), y_(y), margin_m_(margin_m), reach_m_(edit.reach_m() + margin_m) {
  const std::size_t bands = edit.band_begins.size() - 1;
  const std::size_t first = BandOf(edit, y - margin_m, bands), last = BandOf(edit, y + margin_m, bands);
  std::vector<Edit::EdgeNumber> several;
  std::span<const Edit::EdgeNumber> numbers(edit.band_edges);
  numbers = numbers.subspan(edit.band_begins[first], edit.band_begins[last + 1] - edit.band_begins[first]);
  if (first != last) {  // an edge may be in several bands
    several.assign(numbers.begin(), numbers.end());
    std::ranges::sort(several);
    several.erase(std::unique(several.begin(), several.end()), several.end());
    numbers = several;
  }
  for (const auto& [r, e] : numbers) {
    const auto& ring = edit.rings[r];
    const PlanPoint a = ring[e], b = ring[(e + 1) % ring.size()];
    if (edit.is_area && (a.y <= y) != (b.y <= y)) crossings_.push_back(a.x + (y - a.y) * (b.x - a.x) / (b.y - a.y));
    const auto [low, high] = std::minmax(a.y, b.y);
    if (y < low - reach_m_ || y > high + reach_m_) continue;
    const double dx = b.x - a.x, dy = b.y - a.y, length2 = dx * dx + dy * dy;
    edges_.push_back({a, b, length2 > 0 ? 1 / length2 : 0, r, e});
  }
  std::ranges::sort(crossings_);
  for (std::size_t t = 0; t < edit.triangles.size(); ++t) {
    const auto& ring = edit.rings.front();
    const auto& [i, j, k] = edit.triangles[t];
    const auto [low, high] = std::minmax({ring[i].y, ring[j].y, ring[k].y});
    if (low <= y && y <= high) triangles_.push_back(static_cast<std::uint32_t>(t));
  }
}

EditPlace EditRow::At(double x) const {
  EditPlace place;
  const auto before = std::ranges::lower_bound(crossings_, x) - crossings_.begin();
  place.is_inside = before % 2 == 1;
  if (place.is_inside && margin_m_ == 0) return place;
  // Beyond the reach nothing depends on the distance.
  double best = std::numeric_limits<double>::infinity();
  for (const Edge& edge : edges_) {
    const auto [west, east] = std::minmax(edge.a.x, edge.b.x);
    if (x < west - reach_m_ || x > east + reach_m_) continue;
    const double dx = edge.b.x - edge.a.x, dy = edge.b.y - edge.a.y;
    const double t = std::clamp(((x - edge.a.x) * dx + (y_ - edge.a.y) * dy) * edge.inverse_length2, 0.0, 1.0);
    const double ex = edge.a.x + t * dx - x, ey = edge.a.y + t * dy - y_, square = ex * ex + ey * ey;
    if (square >= best) continue;
    best = square;
    if (place.is_inside) continue;
    place.ring = edge.ring;
    place.edge = edge.edge;
    place.along = t;
  }
  if (place.is_inside) {
    place.depth_m = std::min(std::sqrt(best), margin_m_);
    return place;
  }
  place.distance_m = std::isfinite(best) ? std::sqrt(best) : 2 * reach_m_ + 1;
  return place;
}

double EditUndulations::At(PlanPoint point) const {
  const auto place = [](double steps, std::size_t nodes) {
    const double clamped = std::clamp(steps, 0.0, static_cast<double>(nodes - 1));
    const std::size_t node = std::min(static_cast<std::size_t>(clamped), nodes - 2);
    return std::pair(node, clamped - static_cast<double>(node));
  };
  const auto [i, x] = place((point.x - south_west.x) / step_x, columns);
  const auto [j, y] = place((point.y - south_west.y) / step_y, rows);
  const double* const south = &values[j * columns + i];
  const double* const north = south + columns;
  return (1 - y) * ((1 - x) * south[0] + x * south[1]) + y * ((1 - x) * north[0] + x * north[1]);
}

namespace {

// How far a point lies inside a triangle, in twice its area; negative outside.
double DepthIn(const std::vector<PlanPoint>& ring, const std::array<std::uint32_t, 3>& triangle, PlanPoint point) {
  const PlanPoint a = ring[triangle[0]], b = ring[triangle[1]], c = ring[triangle[2]];
  const double sign = Cross(a, b, c) < 0 ? -1 : 1;
  return std::min({sign * Cross(a, b, point), sign * Cross(b, c, point), sign * Cross(c, a, point)});
}

// The triangle of a slope in which a point lies deepest. `near`: triangles that may contain it.
const std::array<std::uint32_t, 3>& TriangleAt(const Edit& edit, PlanPoint point, std::span<const std::uint32_t> near) {
  const auto& ring = edit.rings.front();
  double best = -std::numeric_limits<double>::infinity();
  std::size_t deepest = 0;
  const auto examine = [&](std::size_t t) {
    const double depth = DepthIn(ring, edit.triangles[t], point);
    if (depth <= best) return;
    best = depth;
    deepest = t;
  };
  for (const std::uint32_t t : near) examine(t);
  if (best < 0) {  // rounding left it outside of all: the one that it is nearest to
    best = -std::numeric_limits<double>::infinity();
    for (std::size_t t = 0; t < edit.triangles.size(); ++t) examine(t);
  }
  return edit.triangles[deepest];
}

// Above the edit's own datum. `near`: as for TriangleAt.
double StatedTarget(const Edit& edit, PlanPoint point, const EditPlace& place, std::span<const std::uint32_t> near) {
  if (edit.op == EditOp::kFlatten) return edit.height_m;
  if (!place.is_inside) {
    const auto& heights = edit.heights[place.ring];
    const double from = heights[place.edge], to = heights[(place.edge + 1) % heights.size()];
    return from + place.along * (to - from);
  }
  std::array<double, 3> slope = edit.slope;
  if (!edit.triangles.empty()) {
    const auto& ring = edit.rings.front();
    const auto& heights = edit.heights.front();
    const auto& [a, b, c] = TriangleAt(edit, point, near);
    slope = PlaneThrough(ring[a], ring[b], ring[c], heights[a], heights[b], heights[c]);
  }
  return slope[0] * point.x + slope[1] * point.y + slope[2];
}

double Target(const Edit& edit, PlanPoint point, const EditPlace& place, std::span<const std::uint32_t> near,
              HeightDatum datum) {
  const double stated = StatedTarget(edit, point, place, near);
  if (edit.undulations == nullptr || edit.TargetDatum(datum) != HeightDatum::kEllipsoid) return stated;
  return stated + edit.undulations->At(point);
}

}  // namespace

double EditRow::TargetAt(double x, const EditPlace& place, HeightDatum datum) const {
  return Target(edit_, {x, y_}, place, triangles_, datum);
}

double TargetAt(const Edit& edit, PlanPoint point, const EditPlace& place) {
  return Target(edit, point, place, {}, HeightDatum::kEllipsoid);
}

// The ear with the lowest number is cut off next. For every other convex corner one point is known that lies in its
// triangle. The corner is tested again only if this point goes, then from the next point on, or if a neighbour goes. So
// a corner meets each point once for each of its triangles, of which there are at most 3 n in all: O(n^2).
std::vector<std::array<std::uint32_t, 3>> CutEars(const std::vector<PlanPoint>& ring) {
  constexpr std::uint32_t kEar = 0xffffffff, kNever = 0xfffffffe;  // kNever: until a neighbour goes
  const auto n = static_cast<std::uint32_t>(ring.size());
  const double sign = Sign(ring);
  std::vector<std::uint32_t> before(n), after(n), inside(n);
  std::vector<std::uint8_t> is_left(n, 1);
  std::uint32_t left = n;
  for (std::uint32_t i = 0; i < n; ++i) before[i] = (i + n - 1) % n, after[i] = (i + 1) % n;
  const auto find_inside = [&](std::uint32_t b, std::uint32_t from) {
    const std::uint32_t a = before[b], c = after[b];
    for (std::uint32_t k = from; k < n; ++k) {
      if (is_left[k] == 0 || k == a || k == b || k == c) continue;
      if (sign * Cross(ring[a], ring[b], ring[k]) >= 0 && sign * Cross(ring[b], ring[c], ring[k]) >= 0 &&
          sign * Cross(ring[c], ring[a], ring[k]) >= 0) {
        return k;
      }
    }
    return kEar;
  };
  const auto test = [&](std::uint32_t b) {
    const double area = sign * Cross(ring[before[b]], ring[b], ring[after[b]]);
    inside[b] = area < 0 || (area == 0 && left > 3) ? kNever : find_inside(b, 0);
  };
  for (std::uint32_t i = 0; i < n; ++i) test(i);
  std::vector<std::array<std::uint32_t, 3>> triangles;
  while (left >= 3) {
    std::uint32_t ear = 0;
    while (ear < n && (is_left[ear] == 0 || inside[ear] != kEar)) ++ear;
    if (ear == n) return {};
    const std::uint32_t a = before[ear], c = after[ear];
    if (Cross(ring[a], ring[ear], ring[c]) != 0) triangles.push_back({a, ear, c});
    is_left[ear] = 0;
    --left;
    after[a] = c;
    before[c] = a;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (is_left[i] != 0 && inside[i] == ear) inside[i] = find_inside(i, ear + 1);
    }
    test(a);
    test(c);
    if (left == 3) test(after[c]);
  }
  return triangles;
}

namespace {

// Lowest, highest and steepest of the target heights.
void MeasureTarget(Edit& edit) {
  edit.low_m = std::numeric_limits<double>::infinity();
  edit.high_m = -edit.low_m;
  edit.steepest = 0;
  if (edit.op == EditOp::kFlatten) edit.low_m = edit.high_m = edit.height_m;
  if (edit.triangles.empty()) {
    edit.steepest = std::hypot(edit.slope[0], edit.slope[1]);
  } else {
    const auto& ring = edit.rings.front();
    const auto& heights = edit.heights.front();
    for (const auto& [a, b, c] : edit.triangles) {
      const auto slope = PlaneThrough(ring[a], ring[b], ring[c], heights[a], heights[b], heights[c]);
      edit.steepest = std::max(edit.steepest, std::hypot(slope[0], slope[1]));
    }
  }
  for (std::size_t r = 0; r < edit.heights.size(); ++r) {
    for (const double height : edit.heights[r]) {
      edit.low_m = std::min(edit.low_m, height);
      edit.high_m = std::max(edit.high_m, height);
    }
    for (std::size_t e = 0; e < EdgesOf(edit, r); ++e) {
      const auto& ring = edit.rings[r];
      const std::size_t next = (e + 1) % ring.size();
      const double length = std::hypot(ring[next].x - ring[e].x, ring[next].y - ring[e].y);
      if (length > 0)
        edit.steepest = std::max(edit.steepest, std::abs(edit.heights[r][next] - edit.heights[r][e]) / length);
    }
  }
}

// The range and the steepest slope of the undulations are added to those of the heights.
void AddUndulations(Edit& edit) {
  if (edit.undulations == nullptr) return;
  const EditUndulations& patch = *edit.undulations;
  const auto [low, high] = std::ranges::minmax(patch.values);
  edit.low_m += low;
  edit.high_m += high;
  double east = 0, north = 0;
  for (std::size_t j = 0; j < patch.rows; ++j) {
    for (std::size_t i = 0; i < patch.columns; ++i) {
      const double* const at = &patch.values[j * patch.columns + i];
      if (i + 1 < patch.columns) east = std::max(east, std::abs(at[1] - at[0]) / patch.step_x);
      if (j + 1 < patch.rows) north = std::max(north, std::abs(at[patch.columns] - at[0]) / patch.step_y);
    }
  }
  edit.steepest += std::hypot(east, north);
}

// The edges that two rings share, ascending, as where a polygon is divided at 180 degrees. The polygons lie on both
// sides of them, or on none, so they are no part of the outline.
std::vector<Edit::EdgeNumber> SharedEdges(const Edit& edit) {
  std::vector<Edit::EdgeNumber> shared;
  if (!edit.is_area || edit.rings.size() < 2) return shared;
  std::vector<std::pair<std::array<double, 4>, Edit::EdgeNumber>> edges;
  for (std::uint32_t r = 0; r < edit.rings.size(); ++r) {
    const auto& ring = edit.rings[r];
    for (std::uint32_t e = 0; e < ring.size(); ++e) {
      std::array<double, 2> a{ring[e].x, ring[e].y};
      std::array<double, 2> b{ring[(e + 1) % ring.size()].x, ring[(e + 1) % ring.size()].y};
      if (b < a) std::swap(a, b);
      edges.push_back({{a[0], a[1], b[0], b[1]}, {r, e}});
    }
  }
  std::ranges::sort(edges);
  for (std::size_t i = 1; i < edges.size(); ++i) {
    if (edges[i].first != edges[i - 1].first) continue;
    shared.insert(shared.end(), {edges[i - 1].second, edges[i].second});
    ++i;
  }
  std::ranges::sort(shared);
  return shared;
}

// As many bands as leave each edge in four on average: tall edges and wide blends are in many.
void DivideIntoBands(Edit& edit, const std::vector<Edit::EdgeNumber>& shared, double south, double north) {
  const double reach = edit.reach_m();
  std::size_t edges = 0;
  for (std::size_t r = 0; r < edit.rings.size(); ++r) edges += EdgesOf(edit, r);
  edit.bands_from = south - reach;
  const double height = north - south + 2 * reach;
  const auto for_bands = [&](std::size_t bands, const auto& visit) {
    for (std::uint32_t r = 0; r < edit.rings.size(); ++r) {
      const auto& ring = edit.rings[r];
      for (std::uint32_t e = 0; e < EdgesOf(edit, r); ++e) {
        if (std::ranges::binary_search(shared, Edit::EdgeNumber{r, e})) continue;
        const auto [low, high] = std::minmax(ring[e].y, ring[(e + 1) % ring.size()].y);
        visit(Edit::EdgeNumber{r, e}, BandOf(edit, low - reach, bands), BandOf(edit, high + reach, bands));
      }
    }
  };
  std::size_t bands = height > 0 ? std::bit_ceil(edges / 8 + 1) : 1;
  for (;; bands /= 2) {
    edit.bands_per_m = height > 0 ? static_cast<double>(bands) / height : 0;
    std::size_t entries = 0;
    for_bands(bands, [&](Edit::EdgeNumber, std::size_t first, std::size_t last) { entries += last - first + 1; });
    if (bands == 1 || entries <= 4 * edges) break;
  }
  edit.band_begins.assign(bands + 1, 0);
  for_bands(bands, [&](Edit::EdgeNumber, std::size_t first, std::size_t last) {
    for (std::size_t b = first; b <= last; ++b) ++edit.band_begins[b + 1];
  });
  std::partial_sum(edit.band_begins.begin(), edit.band_begins.end(), edit.band_begins.begin());
  edit.band_edges.resize(edit.band_begins.back());
  std::vector<std::size_t> next = edit.band_begins;
  for_bands(bands, [&](Edit::EdgeNumber number, std::size_t first, std::size_t last) {
    for (std::size_t b = first; b <= last; ++b) edit.band_edges[next[b]++] = number;
  });
}

void HashContent(Edit& edit, bool has_shared_edges) {
  ContentHasher hasher;
  if (has_shared_edges) hasher.Add(std::uint8_t{1});  // of the rule about them
  hasher.Add(static_cast<std::uint8_t>(edit.op));
  if (edit.op == EditOp::kPrecision)
    hasher.Add(std::uint8_t{4});  // of the rules of borders and corners (tin::BorderOptions, proto::EdgeErrors)
  hasher.Add(edit.is_area);
  for (const double value : {edit.plane.longitude, edit.plane.latitude, edit.blend_m, edit.half_width_m, edit.height_m,
                             edit.offset_m, edit.error_m, edit.factor}) {
    hasher.Add(value);
  }
  hasher.Add(edit.min_level);
  for (const auto& ring : edit.rings) {
    hasher.Add(std::uint64_t{ring.size()});
    for (const PlanPoint point : ring) {
      hasher.Add(point.x);
      hasher.Add(point.y);
    }
  }
  for (const auto& heights : edit.heights) {
    for (const double height : heights) hasher.Add(height);
  }
  if (edit.undulations != nullptr) {
    for (const double value : edit.undulations->values) hasher.Add(value);
    hasher.Add(edit.is_in_source_datum);
  }
  edit.hash = hasher.Hash();
}

}  // namespace

void Complete(Edit& edit) {
  double west = 0, east = 0, south = 0, north = 0;
  for (const auto& ring : edit.rings) {
    for (const PlanPoint point : ring) {
      west = std::min(west, point.x);
      east = std::max(east, point.x);
      south = std::min(south, point.y);
      north = std::max(north, point.y);
    }
  }
  const double reach = edit.reach_m();
  const EditPlane& plane = edit.plane;
  edit.reach = {plane.longitude + (west - reach) / plane.east_m, plane.latitude + (south - reach) / plane.north_m,
                plane.longitude + (east + reach) / plane.east_m, plane.latitude + (north + reach) / plane.north_m};
  constexpr double kSlack = 1e-9;
  edit.reach.Grow(kSlack, kSlack);
  const std::vector<Edit::EdgeNumber> shared = SharedEdges(edit);
  DivideIntoBands(edit, shared, south, north);
  edit.is_convex = edit.is_area && edit.rings.size() == 1 && IsConvex(edit.rings.front());
  MeasureTarget(edit);
  AddUndulations(edit);
  HashContent(edit, !shared.empty());
}

}  // namespace terrace::dem
