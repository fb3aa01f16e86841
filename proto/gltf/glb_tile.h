// A GridMesh as a GLB tile of 3D Tiles: docs/formats/glb.md has the layout.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "proto/gltf/draco_mesh.h"
#include "proto/gltf/gltf_types.h"
#include "proto/mesh/grid_mesh.h"

namespace terrace::proto {

// The width of positions for a form (see GridStep).
constexpr PositionWidth WidthOf(GlbCompression compression) {
  const bool narrow = compression == GlbCompression::kQuantized || compression == GlbCompression::kMeshopt;
  return narrow ? PositionWidth::k16Bits : PositionWidth::kFloat;
}

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
  // Metres: written to the scene's extras if known and finite.
  std::optional<double> max_error_m = {}, certified_error_m = {};
};

struct GlbTile {
  std::string bytes;
  // Of the decoded mesh, including skirts.
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
};

// Pure and thread-safe. kInternal: a coder failed, or decodes to something else (draco_mesh.h).
// Precondition: at least one triangle.
Result<GlbTile> EncodeGlb(const GridMesh& mesh, const GlbOptions& options);

}  // namespace terrace::proto
