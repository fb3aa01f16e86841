// The track of a flight over the tiles that were loaded, as SVG.
#pragma once

#include <string>
#include <vector>

#include "fly/flight/statistics.h"

namespace terrace::fly {

// North is up. Shows the surroundings of the track. Each tile appears once; deep ones cover shallow ones.
std::string MapOf(const std::vector<geo::TileKey>& tiles, const std::vector<GeodeticPoint>& track);

// A colour for a level, from violet for shallow ones to yellow for the deepest.
std::string ColorOfLevel(int level, int shallowest, int deepest);

}  // namespace terrace::fly
