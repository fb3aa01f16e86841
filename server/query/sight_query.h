// A parsed request for lines of sight. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "server/query/points_input.h"
#include "tiler/surface/drawn_surface.h"

namespace terrace::server {

struct SightQuery {
  std::vector<dem::SightRay> rays;
  dem::SightOptions options;
  bool from_ground = false;  // heights of the ends are above the surface; else above the ellipsoid
  bool is_binary = false;    // rays were numbers of 64 bits, and the answers are to be numbers of 32 bits
  std::optional<tiler::DrawnSurface> drawn;  // nothing: the surface of the sources
  bool names_source = false;                 // surface=source was sent
};

// `from=lat,lon,height&to=lat,lon,height`, or `rays=lat,lon,height,lat,lon,height|...`; `heights=ellipsoid` or
// `heights=ground`, `refraction=K`, and the parameters of surfaces (drawn_parameters.h); `v` is ignored. Or a body of
// longitude, latitude and height of both ends of each ray as little-endian 64-bit floats. kInvalidArgument: anything
// else, a position not on Earth, a height out of range, a ray longer than kMaxSightLength, or more than `max_rays`;
// the message is for the client. kCancelled: a stop was requested.
Result<SightQuery> ParseSight(const PointsInput& input, std::size_t max_rays, const std::stop_token& stop = {});

}  // namespace terrace::server
