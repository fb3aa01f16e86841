// Which of the ways to count heights a source uses: as its reference system states it, or as its owner says.
#pragma once

#include <memory>
#include <string>

#include "engine/core/result.h"
#include "engine/dem/crs/geoid.h"
#include "engine/dem/crs/georeference.h"

namespace terrace::dem {

struct VerticalDatum {
  std::string name;                    // for people: "EGM96 height", "ellipsoid"; empty: not known
  std::shared_ptr<const Geoid> geoid;  // null: heights are ellipsoidal, or pass as if they were

  bool is_known() const { return !name.empty(); }
  // Heights of both can be mixed.
  bool IsSame(const VerticalDatum& other) const {
    return name == other.name && (geoid == nullptr) == (other.geoid == nullptr) &&
           (geoid == nullptr || geoid->pipeline() == other.geoid->pipeline());
  }
};

// `wanted`: "crs" (what the reference system states; unknown where it states nothing), "unknown", "ellipsoid", "egm96",
// "egm2008", a vertical reference system such as "EPSG:5703", or the path of a grid of undulations. `centre`: of the
// source, degrees. kInvalidArgument and kNotFound say what is missing and what to do; they do not name the source.
//
// Ellipsoidal heights above another ellipsoid than that of WGS 84 pass through.
Result<VerticalDatum> ResolveVertical(const std::string& wanted, const Georeference& stated, Position centre);

}  // namespace terrace::dem
