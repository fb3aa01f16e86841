#include "engine/edits/edit_polygon.h"

#include <algorithm>
#include <boost/geometry/algorithms/correct.hpp>
#include <boost/geometry/algorithms/envelope.hpp>
#include <boost/geometry/algorithms/intersection.hpp>
#include <boost/geometry/algorithms/intersects.hpp>
#include <boost/geometry/algorithms/is_valid.hpp>
#include <boost/geometry/algorithms/relate.hpp>
#include <boost/geometry/algorithms/unique.hpp>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/multi_point.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/polygon.hpp>
#include <boost/geometry/geometries/segment.hpp>
#include <boost/geometry/strategies/strategies.hpp>

namespace terrace::dem {
namespace {

using Point = boost::geometry::model::d2::point_xy<double>;
using Polygon = boost::geometry::model::polygon<Point>;

Polygon PolygonOf(const RingsOfPart& part) {
  Polygon polygon;
  polygon.inners().resize(part.size() - 1);
  for (std::size_t r = 0; r < part.size(); ++r) {
    auto& ring = r == 0 ? polygon.outer() : polygon.inners()[r - 1];
    for (const GeoPosition& at : part[r]) ring.emplace_back(at.longitude, at.latitude);
    ring.push_back(ring.front());
  }
  boost::geometry::correct(polygon);
  return polygon;
}

// A side of a ring. Sides are numbered, ring after ring.
struct Side {
  boost::geometry::model::segment<Point> segment;
  std::size_t number = 0;
  std::size_t first = 0, last = 0;  // of its ring

  double west() const { return std::min(segment.first.x(), segment.second.x()); }
  double east() const { return std::max(segment.first.x(), segment.second.x()); }
  bool IsNextTo(const Side& other) const {
    const auto [low, high] = std::minmax(number, other.number);
    return first == other.first && (high - low == 1 || (low == first && high == last));
  }
};

// A position that two sides share, other than the corner between two neighbours. Nothing if none is found among the
// first pairs of sides: an invalid polygon must not take longer than a valid one.
std::optional<GeoPosition> SharedPosition(Polygon polygon) {
  boost::geometry::unique(polygon);  // sides on both sides of a repeated corner would share it
  std::vector<Side> sides;
  const auto add = [&](const auto& ring) {
    if (ring.size() < 2) return;  // its positions are all one
    const std::size_t first = sides.size(), last = first + ring.size() - 2;
    for (std::size_t i = 0; first + i <= last; ++i) sides.push_back({{ring[i], ring[i + 1]}, first + i, first, last});
  };
  add(polygon.outer());
  for (const auto& inner : polygon.inners()) add(inner);
  std::ranges::sort(sides, {}, &Side::west);
  constexpr std::size_t kMaxPairs = 1'000'000;
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < sides.size(); ++i) {
    for (std::size_t k = i + 1; k < sides.size() && sides[k].west() <= sides[i].east(); ++k) {
      if (++pairs > kMaxPairs) return std::nullopt;
      boost::geometry::model::multi_point<Point> shared;
      boost::geometry::intersection(sides[i].segment, sides[k].segment, shared);
      const std::size_t allowed = sides[i].IsNextTo(sides[k]) ? 1 : 0;
      if (shared.size() > allowed) return GeoPosition{shared.front().x(), shared.front().y()};
    }
  }
  return std::nullopt;
}

struct PartInBox {
  Polygon polygon;
  boost::geometry::model::box<Point> box;

  double west() const { return box.min_corner().x(); }
  double east() const { return box.max_corner().x(); }
};

}  // namespace

std::optional<PolygonFault> FaultOf(const RingsOfPart& part) {
  const Polygon polygon = PolygonOf(part);
  if (boost::geometry::intersects(polygon)) {
    return PolygonFault{"its rings intersect themselves or each other", SharedPosition(polygon)};
  }
  boost::geometry::validity_failure_type type{};
  if (boost::geometry::is_valid(polygon, type) || type == boost::geometry::failure_duplicate_points) return {};
  PolygonFault fault;
  boost::geometry::is_valid(polygon, fault.what);
  return fault;
}

std::optional<GeoPosition> FirstOverlap(std::span<const RingsOfPart> parts) {
  if (parts.size() < 2) return std::nullopt;
  std::vector<PartInBox> sorted;
  for (const RingsOfPart& part : parts) {
    PartInBox& next = sorted.emplace_back();
    next.polygon = PolygonOf(part);
    boost::geometry::envelope(next.polygon, next.box);
  }
  // A part can overlap only those that begin west of its end.
  std::ranges::sort(sorted, {}, &PartInBox::west);
  const boost::geometry::de9im::mask has_common_inside("T********");
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    for (std::size_t k = i + 1; k < sorted.size() && sorted[k].west() < sorted[i].east(); ++k) {
      if (!boost::geometry::intersects(sorted[i].box, sorted[k].box)) continue;
      if (!boost::geometry::relate(sorted[i].polygon, sorted[k].polygon, has_common_inside)) continue;
      const Point& at = sorted[k].polygon.outer().front();
      return GeoPosition{at.x(), at.y()};
    }
  }
  return std::nullopt;
}

}  // namespace terrace::dem
