// Takes finished units from an older archive.
#pragma once

#include <string>

#include "archive/manifest.h"
#include "archive/tile_writer.h"
#include "engine/core/result.h"

namespace terrace::bake {

// Copies a unit's file from one archive's folder to another's, by rename, and verifies the copy. `entry`: from the old
// archive's manifest. kNotFound, kInvalidArgument: the old file is missing or damaged: bake the unit. kUnavailable: the
// new place cannot be written.
Result<archive::UnitSummary> CopyUnit(const std::string& from, const std::string& to, const archive::UnitEntry& entry);

}  // namespace terrace::bake
