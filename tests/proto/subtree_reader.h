// Reads .subtree files as the specification says, for tests: knows nothing of the writer.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"

namespace terrace::proto {

// A bitstream, or a constant spelt out: one entry per bit.
using BitList = std::vector<bool>;

struct ReadSubtree {
  BitList tiles, contents, children;
  bool tiles_constant = false, children_constant = false;
  // TILE_MINIMUM_HEIGHT and TILE_MAXIMUM_HEIGHT by the tile's bit, NaN where there is no tile; empty: no metadata.
  std::vector<float> min_heights, max_heights;
  std::string json;
};

// kInvalidArgument, with what is wrong: a length, an offset or an alignment that is not as it must be, bits set after
// the last one, a count that does not fit, tiles whose parent is missing.
Result<ReadSubtree> ParseSubtree(std::string_view file, int levels);

}  // namespace terrace::proto
