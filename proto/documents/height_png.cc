#include "proto/documents/height_png.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/core/check.h"
#include "proto/documents/png.h"

namespace terrace::proto {
namespace {

constexpr std::uint32_t kLastCode = (1u << 24) - 1;

}  // namespace

std::uint32_t EncodeHeight(double metres, HeightEncoding encoding) {
  const double code = encoding == HeightEncoding::kMapbox ? (metres + 10000) * 10 : (metres + 32768) * 256;
  return static_cast<std::uint32_t>(std::clamp(std::round(code), 0.0, static_cast<double>(kLastCode)));
}

double DecodeHeight(std::uint32_t code, HeightEncoding encoding) {
  return encoding == HeightEncoding::kMapbox ? code / 10.0 - 10000 : code / 256.0 - 32768;
}

std::string EncodeHeightPng(std::span<const float> heights, int size, HeightEncoding encoding) {
  const auto width = static_cast<std::size_t>(size);
  TERRACE_CHECK(size > 0 && heights.size() == width * width);
  std::vector<std::uint8_t> rgb;
  rgb.reserve(3 * heights.size());
  for (const float height : heights) {
    const std::uint32_t code = EncodeHeight(height, encoding);
    for (const int shift : {16, 8, 0}) rgb.push_back(static_cast<std::uint8_t>(code >> shift));
  }
  return EncodePng({size, size, PixelKind::kRgb, rgb});
}

}  // namespace terrace::proto
