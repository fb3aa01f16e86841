// Converts raw samples of a band to heights, with SIMD. Results are bit-equal on all sets of instructions.
#pragma once

#include <gdal.h>

#include <cstddef>

namespace terrace::dem {

// Metres. Heights beyond the limits or equal to `nodata` are voids. `nodata` is NaN if there is no such value.
struct HeightLimits {
  float nodata = 0, lowest = 0, highest = 0;
};

// Writes a height for each of `count` raw values, which are metres; voids are NaN, and -0 becomes 0. `type`: GDT_Byte,
// GDT_Int16, GDT_UInt16 or GDT_Float32.
void ConvertSamples(GDALDataType type, const std::byte* raw, std::size_t count, const HeightLimits& limits,
                    float* heights);

}  // namespace terrace::dem
