// Takes finished units from an older archive.
#pragma once

#include <string>

#include "archive/manifest.h"
#include "archive/unit_writer.h"
#include "engine/core/result.h"

namespace terrace::bake {

// Copies a unit's file from one archive's folder to another's, if it is the file that `entry`, of the old archive's
// manifest, describes. The new file appears when it is complete. kNotFound: the old file is missing. kInvalidArgument:
// it is another file. In both cases bake the unit. kUnavailable: the old file cannot be read, or the new place cannot
// be written.
Result<archive::FileSummary> CopyUnit(const std::string& from, const std::string& to, const archive::UnitEntry& entry);

}  // namespace terrace::bake
