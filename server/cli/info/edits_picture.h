// A picture of edits for people: hill shade of the edited terrain, and the features.
#pragma once

#include <string>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"

namespace terrace::cli {

// A PNG of 1024 x 1024 pixels, north up, of the edits and a quarter of their extent around them. Holes are black. Each
// operation has its colour (docs/edits.md). Precondition: there are edits.
Result<std::string> DrawEdits(const dem::ElevationModel& model);

// "12 edits: 3 flatten, 9 hole"
std::string CountEdits(const dem::ElevationModel& model);

}  // namespace terrace::cli
