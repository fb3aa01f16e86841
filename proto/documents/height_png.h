// Heights as the colours of PNG images: the "raster-dem" tiles of MapLibre, Mapbox and deck.gl.
//
// PNG with red, green and blue (png.h), without alpha, so that browsers pass the stored bytes on unchanged.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "engine/core/names.h"

namespace terrace::proto {

enum class HeightEncoding : std::uint8_t {
  kMapbox,    // -10000 + (R * 65536 + G * 256 + B) * 0.1 metres
  kTerrarium  // R * 256 + G + B / 256 - 32768 metres
};

inline constexpr Names<HeightEncoding, 2> kHeightEncodingNames = {
    {{"mapbox", HeightEncoding::kMapbox}, {"terrarium", HeightEncoding::kTerrarium}}};

// The code nearest to a height, clamped to the first and the last code. Precondition: finite.
std::uint32_t EncodeHeight(double metres, HeightEncoding encoding);
double DecodeHeight(std::uint32_t code, HeightEncoding encoding);

// `heights`: size * size, row by row from the north-western one, finite.
std::string EncodeHeightPng(std::span<const float> heights, int size, HeightEncoding encoding);

}  // namespace terrace::proto
