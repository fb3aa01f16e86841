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

struct TinMesh {
  std::vector<SamplePosition> vertices;                 // the field's four corners first, then in order of insertion
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise in (x, y); they cover the field exactly once
};

}  // namespace terrace::tin
