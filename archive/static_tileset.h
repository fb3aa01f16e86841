// The files of a 3D Tiles tileset that needs no server: tileset.json, subtrees, GLB tiles.
#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

#include "archive/archive.h"
#include "engine/core/result.h"

namespace terrace::archive {

// Takes one file. `is_gzip`: a tile that is compressed with gzip.
using TakeFile = std::function<Result<void>(const std::string& path, std::string_view bytes, bool is_gzip)>;

// Calls `take` for each file, in an order that depends on the archive alone. Paths are relative to the tileset.
// `has_versions`: URLs have the version as a parameter, for caches; programs that read files would take it for a part
// of the file name. Tiles above the tileset's roots are left out: no client asks for them. Precondition: an archive of
// GLB tiles. kCancelled: stopped. Errors: those of `take` and of Archive::ForEach.
Result<void> ForEachFileOfTileset(const Archive& archive, bool has_versions, const TakeFile& take,
                                  const std::stop_token& stop);

}  // namespace terrace::archive
