// Options of GLB tiles.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "proto/gltf/gltf_types.h"

namespace terrace::proto {

struct DracoOptions {
  int speed = 7;        // 0 smallest .. 10 fastest; 10 is sequential coding, below it edgebreaker
  int normal_bits = 8;  // 2 .. 16, of each of the two coordinates of an oct-encoded normal
  bool uv = false;      // also encodes texture coordinates, 12 bits each; the encoder of GLB tiles sets it
};

// A picture of the tile as an image file. The image's edges are the tile's edges.
struct GlbTexture {
  std::string bytes;
  std::string_view media_type;  // a literal: "image/jpeg", "image/webp"
};

struct GlbOptions {
  GlbCompression compression = GlbCompression::kDraco;
  DracoOptions draco;
  std::string generator = "terrace";       // asset.generator
  std::optional<GlbTexture> texture = {};  // none: the ground is plain grey
  std::string copyright = {};              // asset.copyright (glTF 2.0, 3.2); empty: none
  // Metres, in the scene's extras if set and finite.
  std::optional<double> max_error_m = {}, certified_error_m = {};
};

}  // namespace terrace::proto
