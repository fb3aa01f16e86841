// Normals of the sources' surface at points.
#pragma once

#include <array>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"

namespace terrace::tiler {

// Unit vectors east, north, up, one for each point, of heights above the ellipsoid. Central differences over the
// spacing of the finest source, half of it on each side; one-sided if one side has no height. NaN if both sides or the
// point have none. Errors: those of ReadPoints.
Result<std::vector<std::array<float, 3>>> SourceNormals(const dem::ElevationModel& model,
                                                        std::span<const dem::GeoPosition> points,
                                                        const std::stop_token& stop);

}  // namespace terrace::tiler
