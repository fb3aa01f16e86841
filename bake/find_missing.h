// Which units of a plan have no file yet.
#pragma once

#include <cstddef>
#include <stop_token>
#include <vector>

#include "bake/baker.h"

namespace terrace::bake {

// The indexes of the units of the plan of which a file is absent or has another key. Reads the keys in the files, but
// not the tiles: damaged tiles are found when the bake is finished. kCancelled: stopped.
Result<std::vector<std::size_t>> FindMissing(const tiler::Dataset& dataset, const std::vector<Target>& targets,
                                             const UnitPlan& plan, const std::stop_token& stop);

}  // namespace terrace::bake
