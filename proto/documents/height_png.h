// Heights as the colours of PNG images: the "raster-dem" tiles of MapLibre, Mapbox and deck.gl.
//
// PNG with red, green and blue (png.h), without alpha, so that browsers pass the stored bytes on unchanged.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "proto/documents/picture_types.h"

namespace terrace::proto {

// The code nearest to a height, clamped to the first and the last code. Precondition: finite.
std::uint32_t EncodeHeight(double metres, HeightEncoding encoding);
double DecodeHeight(std::uint32_t code, HeightEncoding encoding);

// `heights`: size * size, row by row from the north-western one, finite.
std::string EncodeHeightPng(std::span<const float> heights, int size, HeightEncoding encoding);

}  // namespace terrace::proto
