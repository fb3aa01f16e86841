// Subtrees of implicit tilings (3D Tiles 1.1), quadtrees with binary availability.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "engine/core/result.h"

namespace terrace::fly {

class Subtree3d {
 public:
  // `levels`: of the tiling's subtrees. kInvalidArgument if the bytes are not a subtree of that many levels, kNotFound
  // if fly has no reader for its form: JSON, or bits in other files.
  static Result<Subtree3d> Parse(std::string_view bytes, int levels);

  // Availability of the tile (x, y) at `level` below the subtree's root, 0 <= level < levels.
  bool HasTile(int level, std::uint32_t x, std::uint32_t y) const;
  bool HasContent(int level, std::uint32_t x, std::uint32_t y) const;
  // Whether another subtree begins at (x, y) on the level below the last one.
  bool HasSubtree(std::uint32_t x, std::uint32_t y) const;

 private:
  struct Bits {
    bool constant = false;
    std::vector<std::uint8_t> bytes;  // empty: all bits are `constant`

    bool Get(std::size_t i) const {
      return bytes.empty() ? constant : i / 8 < bytes.size() && (bytes[i / 8] >> (i % 8) & 1) != 0;
    }
  };

  Bits tiles_, contents_, subtrees_;
};

}  // namespace terrace::fly
