// A triangulated irregular network over a height field: which samples are vertices, and how they are joined.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace terrace::tin {

struct SamplePosition {
  std::uint16_t x = 0;
  std::uint16_t y = 0;

  friend bool operator==(SamplePosition, SamplePosition) = default;
};

// A sample's number. Numbers are ordered as row-major indices are, and their position is found without a division.
constexpr std::uint32_t SampleNumber(int x, int y) {
  return static_cast<std::uint32_t>(y) << 16 | static_cast<std::uint32_t>(x);
}
constexpr SamplePosition PositionOf(std::uint32_t number) {
  return {static_cast<std::uint16_t>(number), static_cast<std::uint16_t>(number >> 16)};
}

struct TinMesh {
  // The field's four corners first, counter-clockwise from (0, 0), then in order of insertion.
  std::vector<SamplePosition> vertices;
  // Counter-clockwise in (x, y); they cover the field exactly once.
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

}  // namespace terrace::tin
