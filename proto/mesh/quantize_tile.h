// Quantizes the mesh over a tile's lattice to the integers of a quantized-mesh tile.
#pragma once

#include <cstdint>

#include "engine/tin/mesh/tin_mesh.h"
#include "proto/mesh/edge_steps.h"
#include "proto/mesh/quantized_mesh.h"
#include "proto/tile_samples.h"

namespace terrace::proto {

// The u or v of lattice node i of `cells`: floor(i * 32767 / cells + 1/2), in integers.
constexpr std::uint16_t QuantizedPosition(int i, int cells) {
  return static_cast<std::uint16_t>((2 * i * kQuantizedMax + cells) / (2 * cells));
}

// Rounds edge heights to `steps`, chooses the tile's own height step, and rounds the other heights to it. The step is
// the smallest power of two that covers the relief in 32767 steps and whose multiples are exact in float32 at these
// heights. The height range of the header is at most twice the relief, or 32767 units of float32 at that height.
// Normals are left empty.
QuantizedTile QuantizeTile(const TileSamples& samples, const tin::TinMesh& mesh, const EdgeSteps& steps);

}  // namespace terrace::proto
