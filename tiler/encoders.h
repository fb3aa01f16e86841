// The encoder of each tile format, one row each; server/api/tile_formats.cc has one row for the requests of each
// format.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "tiler/surface/drawn_mesh.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

struct EncodedTile;   // tile/encoded_tile.h
struct EncoderInput;  // tile_pipeline.h

struct Encoder {
  TileFormat format;
  bool needs_refinement;
  // Sets all of `encoded` except the ETag and the time of compression; adds to times.refine.
  Result<void> (*encode)(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
};

// encoders/quantized_mesh.cc, glb.cc, height_png.cc, relief.cc, contours.cc, imagery.cc. kUnavailable: the source, the
// water raster or the image cannot be read now. kCancelled: stopped. kNotFound (height tiles and those for maps):
// deeper than max_mercator_depth; imagery: the dataset has none.
Result<void> EncodeQuantizedMesh(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeGlb(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeHeightPng(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeHillshade(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeSlope(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeContours(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeImagery(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> EncodeGeodeticImagery(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);

inline constexpr Encoder kEncoders[] = {
    {TileFormat::kQuantizedMesh, /*needs_refinement=*/true, EncodeQuantizedMesh},
    {TileFormat::kGlb, /*needs_refinement=*/true, EncodeGlb},
    {TileFormat::kHeightPng, /*needs_refinement=*/false, EncodeHeightPng},
    {TileFormat::kHillshade, /*needs_refinement=*/false, EncodeHillshade},
    {TileFormat::kSlope, /*needs_refinement=*/false, EncodeSlope},
    {TileFormat::kContours, /*needs_refinement=*/false, EncodeContours},
    {TileFormat::kImagery, /*needs_refinement=*/false, EncodeImagery},
    {TileFormat::kGeodeticImagery, /*needs_refinement=*/false, EncodeGeodeticImagery},
};

// The triangles in the bytes that EncodeQuantizedMesh and EncodeGlb make of the same input. Same errors.
Result<DrawnTriangles> DrawnByQuantizedMesh(const EncoderInput& input, const std::stop_token& stop);
Result<DrawnTriangles> DrawnByGlb(const EncoderInput& input, const std::stop_token& stop);

}  // namespace terrace::tiler
