// Other forms of an archive. A bake writes one file per unit (unit_writer.h), which `terrace bake` calls the form
// `chunks`. These functions read the files and write the other form in one deterministic pass. `out` appears by rename
// when it is complete. kCancelled: stopped.
#pragma once

#include <cstddef>
#include <stop_token>
#include <string>

#include "archive/archive.h"
#include "engine/core/result.h"

namespace terrace::archive {

// kInvalidArgument: readers would refuse the file that WriteSingle makes of an archive with this manifest, because its
// metadata are too large.
Result<void> CheckSingle(const std::string& out, const Manifest& manifest, std::size_t max_values = kMaxValues);
// One PMTiles file with all tiles; Archive::Open reads it. kInvalidArgument: see CheckSingle.
Result<void> WriteSingle(const Archive& archive, const std::string& out, const std::stop_token& stop = {});

// A folder for static hosts: {z}/{x}/{y}.terrain with layer.json, {z}/{x}/{y}.png with tiles.json, or tileset.json with
// subtrees and GLB tiles in 3dtiles/. kInvalidArgument: `out` exists and is not empty.
Result<void> WriteFolder(const Archive& archive, const std::string& out, const std::stop_token& stop = {});

// One 3TZ file: a zip file with the files of the folder of GLB tiles and an index. URLs have no versions. Compressed
// tiles are deflated entries. kInvalidArgument: the archive does not hold GLB tiles.
Result<void> Write3tz(const Archive& archive, const std::string& out, const std::stop_token& stop = {});

}  // namespace terrace::archive
