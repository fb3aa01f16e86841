// Which program makes the bytes: two processes with the same number make the same tile from the same dataset.
#pragma once

#include <cstdint>

namespace terrace::tiler {

// A hash of the build ids (of the program and of every shared library that it was linked to), so that tiles kept on
// disk do not outlive an update of the encoders, of GDAL or of the compressor. Libraries without a build id count by
// name, size and time of their file. To be called before libraries are loaded on the way; later calls give the same.
std::uint64_t EncoderVersion();

}  // namespace terrace::tiler
