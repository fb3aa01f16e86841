// What is kept of a decoded tile: its extent, not its vertices. Nothing is drawn.
#pragma once

#include <cstdint>
#include <optional>

namespace terrace::fly {

struct HeightSpan {
  double min_m = 0, max_m = 0;  // above the ellipsoid
};

struct TileContent {
  std::uint32_t vertices = 0;
  std::uint32_t triangles = 0;
  std::uint64_t bytes = 0;            // of positions, normals and indices as a client keeps them
  std::optional<HeightSpan> heights;  // quantized-mesh states them
  // The share of the tile's rectangle that triangles cover, seen from above: 1 unless the server cut holes. Negative if
  // unknown (GLB).
  double covered = -1;
};

}  // namespace terrace::fly
