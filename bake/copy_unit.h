// Takes finished units from an older archive.
#pragma once

#include <string>

#include "archive/manifest.h"
#include "archive/tile_writer.h"
#include "engine/core/result.h"

namespace terrace::bake {

// Copies a unit's file from one archive's folder to another's, by rename, if it is the file that `entry`, of the old
// archive's manifest, describes. kNotFound, kInvalidArgument: the old file is missing or another one: bake the unit.
// kUnavailable: the old file cannot be read, or the new place cannot be written.
Result<archive::UnitSummary> CopyUnit(const std::string& from, const std::string& to, const archive::UnitEntry& entry);

}  // namespace terrace::bake
