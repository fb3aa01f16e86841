// What heights are multiples of: where sums of them are exact in single precision, scans need no other.
#pragma once

#include <cstddef>

namespace terrace::tin {

// A power of two, metres, that all of the heights are multiples of: 1, 2^-10 or 2^-14, the largest that fits; 0 if none
// does. NaN is a multiple of anything.
float QuantumOf(const float* heights, std::size_t count);

}  // namespace terrace::tin
