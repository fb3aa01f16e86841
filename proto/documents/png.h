// PNG images (ISO/IEC 15948) with 8 bits a sample, without colour profile, so that browsers pass the stored bytes on
// unchanged. Deterministic: filters are chosen by sums of integers, and the compressor is libdeflate.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>

namespace terrace::proto {

// The value is the number of samples of a pixel.
enum class PixelKind : std::uint8_t { kGrey = 1, kGreyAlpha = 2, kRgb = 3, kRgba = 4 };

struct PixelView {
  int width = 0, height = 0;
  PixelKind kind = PixelKind::kRgb;
  std::span<const std::uint8_t> samples;  // row by row from the top
};

// Preconditions: sides of at least 1, width * height pixels.
std::string EncodePng(const PixelView& pixels);

// Red, green, blue and alpha of a palette's entries.
using Palette = std::span<const std::array<std::uint8_t, 4>>;

// An image of indices into a palette. Smaller if entries with alpha come first. Preconditions: pixels of kind kGrey, a
// palette of 1 .. 256 entries, indices within it.
std::string EncodePalettePng(const PixelView& indices, Palette palette);

}  // namespace terrace::proto
