// Edits of many vertices and many edits: what is found by bands, boxes and windows is what is found without.
#include "engine/edits/edit_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/edits/edit_polygon.h"
#include "engine/edits/edit_shape.h"

namespace terrace::dem {
namespace {

// A jagged ring of about 10 km around 10 E, 50 N.
Edit Star(int vertices, double blend_m) {
  Edit edit;
  edit.plane = {10, 50, 71'696, 111'229};
  edit.height_m = 100;
  edit.blend_m = blend_m;
  auto& ring = edit.rings.emplace_back();
  for (int i = 0; i < vertices; ++i) {
    const double angle = 2 * 3.14159265358979 * i / vertices, radius = i % 2 == 0 ? 10'000 : 9'800;
    ring.push_back({radius * std::cos(angle), radius * std::sin(angle)});
  }
  Complete(edit);
  return edit;
}

TEST(EditPolygon, SaysWhereSidesMeet) {
  std::vector<GeoPosition> star;
  const Edit edit = Star(2'000, 0);
  for (const PlanPoint& at : edit.rings.front()) star.push_back({10 + at.x / 71'696, 50 + at.y / 111'229});
  EXPECT_FALSE(FaultOf({star}));
  const std::vector<GeoPosition> square = {{0, 0}, {4, 0}, {4, 4}, {0, 4}};
  std::vector<GeoPosition> crossed = star;
  crossed[500] = star[504];
  struct Case {
    RingsOfPart part;
    GeoPosition low, high;  // a box around the meeting
  };
  const std::vector<Case> cases = {
      {{crossed}, {star[504].longitude, 50.088}, {star[499].longitude, 50.09}},
      {{{{0, 0}, {4, 0}, {4, 4}, {2, -2}, {0, 4}}}, {1, 0}, {3, 0}},
      {{{{0, 0}, {4, 0}, {4, 4}, {4, 6}, {4, 4}, {0, 4}}}, {4, 4}, {4, 6}},
      {{square, {{1, 1}, {1, 1}, {5, 1}, {2, 3}}}, {4, 1}, {4, 2}},
      {{{{1, 1}, {1, 1}, {1, 1}}, {{0, 0}, {4, 4}, {4, 0}, {0, 4}}}, {1, 1}, {1, 1}},
      {{square, {{1, 1}, {2, 1}, {2, 3}}, {{1.5, 1.2}, {1.5, 0.5}, {1.9, 0.5}}}, {1.5, 1}, {2, 1}}};
  for (const auto& [part, low, high] : cases) {
    const std::optional<PolygonFault> fault = FaultOf(part);
    ASSERT_TRUE(fault && fault->at);
    EXPECT_TRUE(low.longitude <= fault->at->longitude && fault->at->longitude <= high.longitude &&
                low.latitude <= fault->at->latitude && fault->at->latitude <= high.latitude)
        << fault->at->longitude << ' ' << fault->at->latitude;
  }
  const std::optional<PolygonFault> outside = FaultOf({square, {{5, 5}, {6, 5}, {6, 6}}});
  ASSERT_TRUE(outside);
  EXPECT_EQ(outside->what, "Hole lies outside shell");
  ASSERT_TRUE(outside->at);
  EXPECT_GE(outside->at->latitude, 5);
  EXPECT_FALSE(FaultOf({{{0, 0}, {4, 0}, {4, 0}, {4, 4}, {0, 4}}})) << "a repeated corner";
}

TEST(EditRow, HasThePlacesOfAllEdges) {
  for (const double blend_m : {0.0, 300.0, 30'000.0}) {
    const Edit edit = Star(2'000, blend_m);
    if (blend_m < 1'000) {
      EXPECT_GT(edit.band_begins.size(), 10u);
    }
    EXPECT_LE(edit.band_edges.size(), 8'000u);
    Edit whole = edit;
    whole.bands_per_m = 0;
    whole.band_edges.clear();
    for (std::uint32_t e = 0; e < 2'000; ++e) whole.band_edges.push_back({0, e});
    whole.band_begins = {0, 2'000};
    for (int j = -60; j <= 60; ++j) {
      const double y = j % 3 == 0 ? edit.rings[0][static_cast<std::size_t>(j + 60) * 16].y : j * 200.0;
      const EditRow row(edit, y), row_of_whole(whole, y);
      for (int i = -60; i <= 60; ++i) {
        const EditPlace place = row.At(i * 200.0), expected = row_of_whole.At(i * 200.0);
        EXPECT_EQ(place.is_inside, expected.is_inside) << i << " " << j;
        EXPECT_EQ(place.distance_m, expected.distance_m) << i << " " << j;
        EXPECT_EQ(place.edge, expected.edge) << i << " " << j;
        EXPECT_EQ(place.along, expected.along) << i << " " << j;
      }
    }
  }
}

TEST(EditRow, HasTheTargetsOfAllTriangles) {
  Edit edit = Star(300, 0);
  edit.op = EditOp::kSlope;
  auto& heights = edit.heights.emplace_back();
  for (std::size_t i = 0; i < 300; ++i) heights.push_back(static_cast<double>(i * i % 97));
  edit.triangles = CutEars(edit.rings.front());
  ASSERT_EQ(edit.triangles.size(), 298u);
  Complete(edit);
  for (int j = -60; j <= 60; ++j) {
    const double y = j % 3 == 0 ? edit.rings[0][static_cast<std::size_t>(j + 60) * 2].y : j * 170.0;
    const EditRow row(edit, y);
    for (int i = -60; i <= 60; ++i) {
      const EditPlace place = row.At(i * 170.0);
      EXPECT_EQ(row.TargetAt(i * 170.0, place), TargetAt(edit, {i * 170.0, y}, place)) << i << " " << j;
    }
  }
}

TEST(EditSet, StopsBetweenRows) {
  std::vector<Edit> list;
  list.push_back(Star(100, 0));
  const EditSet edits(std::move(list));
  const geo::Lattice lattice{10, 64};
  const double step = lattice.StepDegrees();
  const NodeWindow window{static_cast<std::int64_t>(190 / step) - 2, static_cast<std::int64_t>(140 / step) - 2, 5, 5};
  const std::vector<std::size_t> which = {0};
  const ReadReplacement none = [](const Edit&) -> Result<const ReplacementHeights*> { return nullptr; };
  std::vector<float> heights(25, 0);
  std::stop_source stop;
  ASSERT_TRUE(edits.Apply(lattice, window, which, {}, heights, none, stop.get_token()).has_value());
  EXPECT_EQ(heights[12], 100);
  stop.request_stop();
  const auto stopped = edits.Apply(lattice, window, which, {}, heights, none, stop.get_token());
  ASSERT_FALSE(stopped.has_value());
  EXPECT_EQ(stopped.error().code, ErrorCode::kCancelled);
}

// Rows that are kept from one point to the next are of the right parallel.
TEST(EditSet, HasTheSameHeightAtAPointInAnyOrder) {
  std::vector<Edit> list;
  list.push_back(Star(500, 500));
  const EditSet edits(std::move(list));
  const std::vector<std::size_t> which = {0};
  const auto none = [](const Edit&) { return 0.0; };
  EditRows kept;
  for (const double latitude : {50.0, 50.05, 50.05, 50.0, 50.09}) {
    for (int i = -20; i <= 20; ++i) {
      const GeoPosition at{10 + i * 0.01, latitude};
      EditRows fresh;
      EXPECT_EQ(edits.ApplyAt(at, which, {}, 7, none, kept), edits.ApplyAt(at, which, {}, 7, none, fresh));
    }
  }
  EXPECT_EQ(kept.size(), 1u);
}

TEST(BoxIndex, HasAnyWhereItFindsSome) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(0, 100), size(0, 4);
  const auto box = [&] {
    const double west = place(random), south = place(random);
    return Box{west, south, west + size(random), south + size(random)};
  };
  std::vector<BoxIndex::Entry> entries;
  for (std::size_t i = 0; i < 300; ++i) entries.push_back({box(), i});
  const BoxIndex index(entries);
  int with = 0;
  for (int i = 0; i < 300; ++i) {
    const Box asked = box();
    EXPECT_EQ(index.Any(asked), !index.Find(asked).empty());
    with += index.Any(asked) ? 1 : 0;
  }
  EXPECT_GT(with, 0);
  EXPECT_LT(with, 300);
  EXPECT_FALSE(BoxIndex().Any(box()));
}

// The algorithm without what is remembered: each ear is looked for from the first corner on.
std::vector<std::array<std::uint32_t, 3>> EarsOf(const std::vector<PlanPoint>& ring) {
  const auto cross = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    return (ring[b].x - ring[a].x) * (ring[c].y - ring[a].y) - (ring[b].y - ring[a].y) * (ring[c].x - ring[a].x);
  };
  double twice = 0;
  for (std::uint32_t i = 0; i + 1 < ring.size(); ++i) twice += cross(0, i, i + 1);
  const double sign = twice < 0 ? -1 : 1;
  std::vector<std::uint32_t> left(ring.size());
  for (std::uint32_t i = 0; i < left.size(); ++i) left[i] = i;
  std::vector<std::array<std::uint32_t, 3>> triangles;
  while (left.size() >= 3) {
    const std::size_t n = left.size();
    std::size_t i = 0;
    for (; i < n; ++i) {
      const std::uint32_t a = left[(i + n - 1) % n], b = left[i], c = left[(i + 1) % n];
      const double area = sign * cross(a, b, c);
      if (area < 0 || (area == 0 && n > 3)) continue;
      const auto is_inside = [&](std::uint32_t k) {
        return k != a && k != b && k != c && sign * cross(a, b, k) >= 0 && sign * cross(b, c, k) >= 0 &&
               sign * cross(c, a, k) >= 0;
      };
      if (std::ranges::none_of(left, is_inside)) break;
    }
    if (i == n) return {};
    const std::array<std::uint32_t, 3> triangle = {left[(i + n - 1) % n], left[i], left[(i + 1) % n]};
    if (cross(triangle[0], triangle[1], triangle[2]) != 0) triangles.push_back(triangle);
    left.erase(left.begin() + static_cast<std::ptrdiff_t>(i));
  }
  return triangles;
}

TEST(CutEars, FindsTheEarsThatASearchFromTheStartFinds) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> radius(20, 100);
  for (int k = 0; k < 200; ++k) {
    const int corners = 3 + k % 40;
    std::vector<PlanPoint> ring;
    for (int i = 0; i < corners; ++i) {
      const double angle = (k % 2 == 0 ? 1 : -1) * 2 * 3.14159265358979 * i / corners, r = radius(random);
      // Rounded to few places, so that corners lie on lines and on each other's edges.
      ring.push_back({std::round(r * std::cos(angle)), std::round(r * std::sin(angle))});
    }
    EXPECT_EQ(CutEars(ring), EarsOf(ring)) << k;
  }
}

// A comb of a thousand deep teeth: most corners have another in their triangle.
TEST(CutEars, TakesFiveThousandCorners) {
  std::vector<PlanPoint> ring = {{0, 0}, {5'000, 0}};
  for (int i = 2'499; i > 0; --i) {
    ring.push_back({2.0 * i + 1, 1'000});
    ring.push_back({2.0 * i, 1.0 + i % 7});
  }
  const auto triangles = CutEars(ring);
  ASSERT_EQ(triangles.size(), ring.size() - 2);
  double area = 0, of_ring = 0;
  const auto cross = [](PlanPoint a, PlanPoint b, PlanPoint c) {
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
  };
  for (const auto& [a, b, c] : triangles) {
    EXPECT_GT(cross(ring[a], ring[b], ring[c]), 0);
    area += cross(ring[a], ring[b], ring[c]);
  }
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) of_ring += cross(ring[0], ring[i], ring[i + 1]);
  EXPECT_NEAR(area, of_ring, 1e-6 * of_ring);
}

using Nodes = std::set<std::pair<std::int64_t, std::int64_t>>;

// Of the nodes along a line those in the window, and the number of calls.
Nodes NodesAlong(const geo::Lattice& lattice, const NodeWindow& window, const NodeWindow& clip, PlanPoint a,
                 PlanPoint b, const EditPlane& plane, int& calls) {
  Nodes nodes;
  ForNodesAlong(lattice, clip, plane, a, b, [&](std::int64_t c, std::int64_t r) {
    ++calls;
    const std::int64_t turned = (c - window.column) % lattice.columns();
    const std::int64_t i = turned < 0 ? turned + lattice.columns() : turned, j = r - window.row;
    if (i < window.columns && j >= 0 && j < window.rows) nodes.insert({i, j});
  });
  return nodes;
}

TEST(EditSet, VisitsTheSameNodesOfAWindowThatIsClippedTo) {
  const geo::Lattice lattice{8, 64};
  const NodeWindow all{0, 0, static_cast<int>(lattice.columns()), static_cast<int>(lattice.rows()) + 1};
  std::mt19937 random(2);
  int some = 0;
  // Also at the antimeridian, where the last tile ends with the first column.
  for (const double longitude : {10.0, 179.95, -179.95}) {
    const EditPlane plane{longitude, 50, 71'696, 111'229};
    const auto column = static_cast<std::int64_t>((longitude + 180) / lattice.StepDegrees()) / 64 * 64;
    const NodeWindow window{column, static_cast<std::int64_t>(140 / lattice.StepDegrees()) / 64 * 64, 65, 65};
    std::uniform_real_distribution<double> place(-100'000, 100'000), near(-3'500, 3'500);
    for (int k = 0; k < 400; ++k) {
      const bool is_far = k % 2 == 0;
      const auto at = [&] { return is_far ? place(random) : near(random); };
      const PlanPoint a{at(), at()}, b{at(), at()};
      int calls = 0, calls_of_all = 0;
      const Nodes clipped = NodesAlong(lattice, window, window, a, b, plane, calls);
      EXPECT_EQ(clipped, NodesAlong(lattice, window, all, a, b, plane, calls_of_all)) << k;
      EXPECT_LE(calls, 67) << k;
      some += clipped.empty() ? 0 : 1;
    }
  }
  EXPECT_GT(some, 100);
}

}  // namespace
}  // namespace terrace::dem
