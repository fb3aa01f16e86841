// The vertical datum of a source: as its reference system states it, or as configured.
#pragma once

#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/crs/geoid.h"
#include "engine/crs/georeference.h"

namespace terrace::dem {

struct VerticalDatum {
  std::string name;                    // for people: "EGM96 height", "ellipsoid"; empty: not known
  std::shared_ptr<const Geoid> geoid;  // null: heights are ellipsoidal, or treated as such

  bool is_known() const { return !name.empty(); }
  // Whether heights of both datums can be mixed.
  bool IsSame(const VerticalDatum& other) const {
    return name == other.name && (geoid == nullptr) == (other.geoid == nullptr) &&
           (geoid == nullptr || geoid->pipeline() == other.geoid->pipeline());
  }
};

// `wanted`: "crs" (as the reference system states it; unknown if it states none), "unknown", "ellipsoid", "egm96",
// "egm2008", a vertical reference system such as "EPSG:5703", or the path of a grid of undulations. `centre`: of the
// source, degrees. kInvalidArgument, kNotFound: the message says what is missing and what to do, but does not name the
// source. Heights above another ellipsoid than that of WGS 84 are used unchanged.
Result<VerticalDatum> ResolveVertical(const std::string& wanted, const Georeference& stated, Position centre);

}  // namespace terrace::dem
