// Identifies the program that makes the bytes: two processes with the same number make equal tiles from equal datasets.
#pragma once

#include <cstdint>

namespace terrace::tiler {

// A hash of the build ids of the program and of every shared library that it was linked to, so that tiles on disk are
// not used after an update of the encoders, of GDAL or of a compressor. Libraries without a build id count by name,
// size and time of their file. The first call must precede the loading of further libraries; later calls return the
// same value.
std::uint64_t BuildId();

}  // namespace terrace::tiler
