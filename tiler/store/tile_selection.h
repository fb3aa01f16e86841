// Which tiles to erase from caches: those of one dataset that overlap a box and have one of a range of levels.
#pragma once

#include <cstdint>

#include "engine/common/dem_types.h"
#include "engine/geo/tile_key.h"

namespace terrace::tiler {

struct TileSelection {
  std::uint64_t generation = 0;  // Dataset::cache_generation of the dataset
  int min_level = 0, max_level = geo::kMaxLevel;
  dem::GeoBounds box;  // degrees; west > east: across the antimeridian

  // `is_mercator`: `key` is a tile of Web Mercator's XYZ scheme, and its level is a level of that scheme. A tile that
  // only touches the box is not selected.
  bool Contains(std::uint64_t generation_of_key, const geo::TileKey& key, bool is_mercator) const;
};

}  // namespace terrace::tiler
