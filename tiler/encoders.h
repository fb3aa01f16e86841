// The tile formats and the encoder of each, one row each; server/api/tile_formats.cc has one row for the requests of
// each format.
#pragma once

#include <cstdint>
#include <stop_token>

#include "engine/core/result.h"

namespace terrace::tiler {

struct EncodedTile;   // encoded_tile.h
struct EncoderInput;  // tile_pipeline.h

enum class TileFormat : std::uint8_t { kQuantizedMesh, kGlb, kHeightPng };

struct Encoder {
  TileFormat format;
  bool needs_refinement;
  // Sets all of `encoded` except the ETag and the time of compression; adds to times.refine.
  Result<void> (*encode)(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
};

// encoders/quantized_mesh.cc, glb.cc, height_png.cc. kUnavailable: the source, the water raster or the image cannot be
// read now. kCancelled: stopped. kNotFound (height tiles): deeper than max_mercator_depth.
Result<void> EncodeQuantizedMesh(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeGlb(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeHeightPng(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);

inline constexpr Encoder kEncoders[] = {
    {TileFormat::kQuantizedMesh, /*needs_refinement=*/true, EncodeQuantizedMesh},
    {TileFormat::kGlb, /*needs_refinement=*/true, EncodeGlb},
    {TileFormat::kHeightPng, /*needs_refinement=*/false, EncodeHeightPng},
};

}  // namespace terrace::tiler
