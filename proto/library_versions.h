// The libraries that write bytes of tiles.
#pragma once

#include <string>

namespace terrace::proto {

// "Draco 1.5.5, meshoptimizer 180, ...": names and versions of the encoders and compressors that are in use. Another
// version of one may write other bytes of the same tile.
std::string LibraryVersions();

}  // namespace terrace::proto
