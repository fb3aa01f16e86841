// Enumerations that describe pictures.
#pragma once

#include <cstdint>

namespace terrace::proto {

// Heights as colours (height_png.h).
enum class HeightEncoding : std::uint8_t {
  kMapbox,    // -10000 + (R * 65536 + G * 256 + B) * 0.1 metres
  kTerrarium  // R * 256 + G + B / 256 - 32768 metres
};

// The file format of a picture of a map tile.
enum class PictureFormat : std::uint8_t { kPng, kWebp, kJpeg };

}  // namespace terrace::proto
