// Reads .subtree files for tests, by the specification and independently of the writer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"

namespace terrace::proto {

// A bitstream, or an expanded constant: one entry per bit.
using BitList = std::vector<bool>;

struct ReadSubtree {
  BitList tiles, contents, children;
  bool tiles_constant = false, children_constant = false;
  // TILE_MINIMUM_HEIGHT and TILE_MAXIMUM_HEIGHT by the bit of the tile, NaN if there is no tile; empty: no metadata.
  std::vector<float> min_heights, max_heights;
  std::string json;
};

// kInvalidArgument with the reason: a wrong length, offset or alignment, bits set after the last one, a wrong count, or
// tiles whose parent is missing.
Result<ReadSubtree> ParseSubtree(std::string_view file, int levels);

}  // namespace terrace::proto
