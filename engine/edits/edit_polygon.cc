#include "engine/edits/edit_polygon.h"

#include <algorithm>
#include <boost/geometry/algorithms/correct.hpp>
#include <boost/geometry/algorithms/envelope.hpp>
#include <boost/geometry/algorithms/intersects.hpp>
#include <boost/geometry/algorithms/is_valid.hpp>
#include <boost/geometry/algorithms/relate.hpp>
#include <boost/geometry/geometries/box.hpp>
#include <boost/geometry/geometries/point_xy.hpp>
#include <boost/geometry/geometries/polygon.hpp>
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

struct PartInBox {
  Polygon polygon;
  boost::geometry::model::box<Point> box;

  double west() const { return box.min_corner().x(); }
  double east() const { return box.max_corner().x(); }
};

}  // namespace

std::string FaultOf(const RingsOfPart& part) {
  const Polygon polygon = PolygonOf(part);
  if (boost::geometry::intersects(polygon)) return "its rings intersect themselves or each other";
  std::string why;
  boost::geometry::validity_failure_type type{};
  if (boost::geometry::is_valid(polygon, type) || type == boost::geometry::failure_duplicate_points) return why;
  boost::geometry::is_valid(polygon, why);
  return why;
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
