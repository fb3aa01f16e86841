// A GridMesh as a GLB tile of 3D Tiles: docs/formats/glb.md has the layout.
#pragma once

#include <cstdint>
#include <string>

#include "engine/core/result.h"
#include "proto/gltf/glb_options.h"
#include "proto/mesh/grid_mesh.h"
#include "proto/mesh/position_width.h"

namespace terrace::proto {

// Which of the two grids positions are rounded to: the one for 16 bits, or the finer one for floats. The file may store
// another number type.
constexpr PositionWidth WidthOf(GlbCompression compression) {
  const bool narrow = compression == GlbCompression::kQuantized || compression == GlbCompression::kMeshopt;
  return narrow ? PositionWidth::k16Bits : PositionWidth::kFloat;
}

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
