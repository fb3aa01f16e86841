// Whether the polygons of a feature are valid.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/common/dem_types.h"

namespace terrace::dem {

// The outer ring of a part of a polygon, and its holes: degrees, three positions or more, without the last one of
// GeoJSON, which repeats the first.
using RingsOfPart = std::vector<std::vector<GeoPosition>>;

struct PolygonFault {
  std::string what;  // in the words of GEOS, such as "Self-intersection"
  std::optional<GeoPosition> at;
};

// What is wrong with a part: rings that intersect, spikes, holes outside (OGC 06-103r4, 6.1.11). Nothing: the part is
// valid.
std::optional<PolygonFault> FaultOf(const RingsOfPart& part);

// A position of a part that overlaps another one; parts may touch. What two parts cover would count as outside.
std::optional<GeoPosition> FirstOverlap(std::span<const RingsOfPart> parts);

}  // namespace terrace::dem
