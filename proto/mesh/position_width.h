// The number type of a GLB tile's positions.
#pragma once

#include <cstdint>

namespace terrace::proto {

enum class PositionWidth : std::uint8_t { k16Bits, kFloat };

}  // namespace terrace::proto
