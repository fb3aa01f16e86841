// The way of a flight over the tiles that it loaded, as SVG.
#pragma once

#include <string>
#include <vector>

#include "fly/flight/statistics.h"

namespace terrace::fly {

// North is up. Shows the surroundings of the track, each tile once, deep ones above shallow ones.
std::string MapOf(const std::vector<AskedTile>& asked, const std::vector<GeodeticPoint>& track);

// A colour for a level, from violet for shallow ones to yellow for the deepest.
std::string ColorOfLevel(int level, int shallowest, int deepest);

}  // namespace terrace::fly
