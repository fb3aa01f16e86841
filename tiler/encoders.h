// The encoder of each tile format, one row each. server/api/tile_formats.cc has one row for each suffix of a format's
// URLs.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "proto/tile_samples.h"
#include "tiler/dataset.h"
#include "tiler/store/refined_tile.h"
#include "tiler/surface/drawn_mesh.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

struct EncodedTile;  // tile/encoded_tile.h

// What an encoder makes a tile from.
struct EncoderInput {
  proto::TileSamples samples() const { return {request.key, refined->heights.lattice, refined->heights.heights}; }

  const Dataset& dataset;
  const TileRequest& request;
  const RefinedTile* refined = nullptr;  // null: the format needs none, and reads what it needs
  double error_m = 0;                    // the bound that the mesh keeps
};

struct Encoder {
  TileFormat format;
  bool needs_refinement;
  // Sets the bytes and times.encode. Meshes also set both errors and the counts, and add to times.refine. Height PNGs
  // set max_error_m. Formats without a refinement set times.read.
  Result<void> (*encode)(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
};

// encoders/quantized_mesh.cc, glb.cc, height_png.cc, relief.cc, contours.cc, imagery.cc. kUnavailable: a source, the
// water raster or the image cannot be read now. kChanged: a file of them was replaced. kCancelled: stopped. kInternal:
// a library failed, or a triangle turned over. kNotFound: heights, hillshades, slopes and contours deeper than
// max_mercator_depth; imagery of a dataset without an image. kInvalidArgument: too many pixels of the image are needed
// at once.
Result<void> MakeQuantizedMeshTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> MakeGlbTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> MakeHeightPngTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> MakeHillshadeTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> MakeSlopeTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> MakeContoursTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> MakeImageryTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);
Result<void> MakeGeodeticImageryTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop);

inline constexpr Encoder kEncoders[] = {
    {TileFormat::kQuantizedMesh, /*needs_refinement=*/true, MakeQuantizedMeshTile},
    {TileFormat::kGlb, /*needs_refinement=*/true, MakeGlbTile},
    {TileFormat::kHeightPng, /*needs_refinement=*/false, MakeHeightPngTile},
    {TileFormat::kHillshade, /*needs_refinement=*/false, MakeHillshadeTile},
    {TileFormat::kSlope, /*needs_refinement=*/false, MakeSlopeTile},
    {TileFormat::kContours, /*needs_refinement=*/false, MakeContoursTile},
    {TileFormat::kImagery, /*needs_refinement=*/false, MakeImageryTile},
    {TileFormat::kGeodeticImagery, /*needs_refinement=*/false, MakeGeodeticImageryTile},
};

// The triangles in the bytes that MakeQuantizedMeshTile and MakeGlbTile make of the same input. Same errors.
Result<DrawnTriangles> QuantizedMeshTriangles(const EncoderInput& input, const std::stop_token& stop);
Result<DrawnTriangles> GlbTriangles(const EncoderInput& input, const std::stop_token& stop);

}  // namespace terrace::tiler
