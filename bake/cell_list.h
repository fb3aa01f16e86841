// A list of one-degree cells, for planning a bake before its sources are downloaded.
#pragma once

#include <string_view>

#include "bake/units.h"
#include "engine/core/result.h"

namespace terrace::bake {

// The tiles of a mosaic of the cells that a text lists, one on each line: "N46E008" is the cell whose south-western
// corner lies at 46 degrees north, 8 degrees east. Samples are `arc_seconds` apart from south to north. From west to
// east their spacing is that of the Copernicus DEM: the same below 50 degrees of latitude, 1.5 times to 60, then 2, 3,
// 5 and 10 times. kInvalidArgument: another line, or none; the message names it.
Result<Pyramid> PlanCells(std::string_view text, double arc_seconds, double error_fraction);

}  // namespace terrace::bake
