// The encoder of each tile format, one row each; server/api/tile_formats.cc has one row for the requests of each
// format.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "proto/lattice_view.h"
#include "tiler/encoded_tile.h"
#include "tiler/store/refined_tile.h"
#include "tiler/tile_pipeline.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// What a tile is made from.
struct EncoderInput {
  proto::LatticeView lattice() const { return {request.key, refined->heights.lattice, refined->heights.heights}; }

  const Dataset& dataset;
  const TileRequest& request;
  const RefinedTile* refined = nullptr;  // null: the format needs none, and reads what it needs
  double error_m = 0;                    // the bound that the mesh keeps
};

// Sets all of `encoded` except the ETag, the compression and the times of the refinement.
struct Encoder {
  TileFormat format;
  bool needs_refinement;
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
