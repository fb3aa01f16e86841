#include "engine/edits/edit_polygon.h"

#define GEOS_USE_ONLY_R_API
#include <geos_c.h>

#include <algorithm>
#include <memory>
#include <utility>

namespace terrace::dem {
namespace {

using Context = std::unique_ptr<GEOSContextHandle_HS, decltype(&GEOS_finish_r)>;

Context MakeContext() { return {GEOS_init_r(), GEOS_finish_r}; }

struct Destroy {
  GEOSContextHandle_t context;
  void operator()(GEOSGeometry* geometry) const { GEOSGeom_destroy_r(context, geometry); }
  void operator()(char* text) const { GEOSFree_r(context, text); }
};
using Geometry = std::unique_ptr<GEOSGeometry, Destroy>;

Geometry PolygonOf(GEOSContextHandle_t context, const RingsOfPart& part) {
  std::vector<GEOSGeometry*> rings;
  for (const std::vector<GeoPosition>& ring : part) {
    std::vector<double> x, y;
    for (std::size_t i = 0; i <= ring.size(); ++i) {
      x.push_back(ring[i % ring.size()].longitude);
      y.push_back(ring[i % ring.size()].latitude);
    }
    GEOSCoordSequence* const points =
        GEOSCoordSeq_copyFromArrays_r(context, x.data(), y.data(), nullptr, nullptr, static_cast<unsigned>(x.size()));
    rings.push_back(GEOSGeom_createLinearRing_r(context, points));
  }
  const auto holes = static_cast<unsigned>(rings.size() - 1);
  return {GEOSGeom_createPolygon_r(context, rings.front(), rings.data() + 1, holes), {context}};  // takes the rings
}

struct PartInBox {
  Geometry polygon;
  GeoPosition at;  // of its outer ring
  double west = 0, east = 0;
};

}  // namespace

std::optional<PolygonFault> FaultOf(const RingsOfPart& part) {
  const Context context = MakeContext();
  const Geometry polygon = PolygonOf(context.get(), part);
  char* text = nullptr;
  GEOSGeometry* point = nullptr;
  if (GEOSisValidDetail_r(context.get(), polygon.get(), 0, &text, &point) == 1) return std::nullopt;
  const std::unique_ptr<char, Destroy> reason(text, {context.get()});
  const Geometry place(point, {context.get()});
  PolygonFault fault{reason ? reason.get() : "GEOS cannot examine it", std::nullopt};
  GeoPosition at;
  if (place && GEOSGeomGetX_r(context.get(), place.get(), &at.longitude) == 1 &&
      GEOSGeomGetY_r(context.get(), place.get(), &at.latitude) == 1) {
    fault.at = at;
  }
  return fault;
}

std::optional<GeoPosition> FirstOverlap(std::span<const RingsOfPart> parts) {
  if (parts.size() < 2) return std::nullopt;
  const Context context = MakeContext();
  std::vector<PartInBox> sorted;
  for (const RingsOfPart& part : parts) {
    PartInBox next{PolygonOf(context.get(), part), part.front().front()};
    GEOSGeom_getXMin_r(context.get(), next.polygon.get(), &next.west);
    GEOSGeom_getXMax_r(context.get(), next.polygon.get(), &next.east);
    sorted.push_back(std::move(next));
  }
  // A part can overlap only those that begin west of its end.
  std::ranges::sort(sorted, {}, &PartInBox::west);
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    for (std::size_t k = i + 1; k < sorted.size() && sorted[k].west < sorted[i].east; ++k) {
      // Do their interiors meet? 2: GEOS failed.
      if (GEOSRelatePattern_r(context.get(), sorted[i].polygon.get(), sorted[k].polygon.get(), "T********") != 0) {
        return sorted[k].at;
      }
    }
  }
  return std::nullopt;
}

}  // namespace terrace::dem
