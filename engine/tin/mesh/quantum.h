// The quantum of heights: a common divisor of all samples. It decides where single precision is exact in scans.
#pragma once

#include <cstddef>

namespace terrace::tin {

// The largest of 1, 2^-10 and 2^-14 metres that all heights are multiples of; 0 if none is. NaN is a multiple of
// anything.
float QuantumOf(const float* heights, std::size_t count);

}  // namespace terrace::tin
