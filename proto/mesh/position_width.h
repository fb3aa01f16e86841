// The number type that the grid of a GLB tile's positions is chosen for; see WidthOf (proto/gltf/glb_tile.h).
#pragma once

#include <cstdint>

namespace terrace::proto {

enum class PositionWidth : std::uint8_t { k16Bits, kFloat };

}  // namespace terrace::proto
