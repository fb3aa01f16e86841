// The track of a flight over the tiles that were loaded, as SVG.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "fly/flight/statistics.h"

namespace terrace::fly {

// `tiles`: FlightRecord::loaded_tiles. North is up. Shows the surroundings of the track. Deep tiles cover shallow ones.
std::string MapOf(const std::set<std::tuple<int, std::int64_t, std::int64_t>>& tiles,
                  const std::vector<GeodeticPoint>& track);

}  // namespace terrace::fly
