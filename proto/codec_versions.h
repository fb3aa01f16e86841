// The libraries that tiles are written with.
#pragma once

#include <string>

namespace terrace::proto {

// Names and versions of the encoders and compressors in use: "Draco 1.5.5, meshoptimizer 180, ...". Other versions may
// write other bytes for the same tile.
std::string CodecVersions();

}  // namespace terrace::proto
