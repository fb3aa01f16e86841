// Arrays of heights in which voids are NaN: finding, counting and replacing the NaNs, with SIMD.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace terrace::dem {

// Returns `count` NaNs.
std::vector<float> NaNHeights(std::size_t count);

// Makes all heights equal to one.
void FillWith(float height, std::span<float> heights);

// Replaces each NaN.
void ReplaceVoids(std::span<float> heights, float by);

// Whether a height is NaN.
bool HasVoids(std::span<const float> heights);

std::size_t CountVoids(std::span<const float> heights);

// Marks the nodes whose height is wanted: 1 where `inside` is 1 and the height is NaN, else 0. Returns whether there is
// one. Precondition: all spans have one entry per node.
bool WantVoids(std::span<const std::uint8_t> inside, std::span<const float> heights, std::span<std::uint8_t> wanted);

}  // namespace terrace::dem
