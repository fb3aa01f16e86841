// Other forms of an archive. A bake writes chunks (tile_writer.h); these functions read them and write the other form,
// as one deterministic pass. `out` appears by rename when it is complete. kCancelled: stopped.
#pragma once

#include <stop_token>
#include <string>

#include "archive/archive.h"
#include "engine/core/result.h"

namespace terrace::archive {

// One PMTiles file with all tiles; Archive::Open reads it.
Result<void> WriteSingle(const Archive& archive, const std::string& out, const std::stop_token& stop = {});

// A folder for static hosts: {z}/{x}/{y}.terrain with layer.json, or {z}/{x}/{y}.png with tiles.json. kInvalidArgument:
// `out` exists and is not empty, or these are GLB tiles.
Result<void> WriteFolder(const Archive& archive, const std::string& out, const std::stop_token& stop = {});

}  // namespace terrace::archive
