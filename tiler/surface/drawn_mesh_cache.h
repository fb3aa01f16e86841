// Meshes of tiles as clients decode them, kept between requests for heights.
#pragma once

#include <cstddef>
#include <cstdint>

#include "proto/mesh/position_width.h"
#include "tiler/store/byte_cache.h"
#include "tiler/surface/drawn_mesh.h"

namespace terrace::tiler {

struct DrawnMeshKey {
  std::uint64_t generation = 0;  // Dataset::generation: with the edits
  geo::TileKey key;
  int error_step = 0;
  bool is_glb = false;
  proto::PositionWidth width = proto::PositionWidth::kFloat;  // of GLB tiles

  friend bool operator==(const DrawnMeshKey&, const DrawnMeshKey&) = default;
};

struct DrawnMeshKeyHash {
  std::size_t operator()(const DrawnMeshKey& key) const noexcept {
    std::uint64_t hash = key.generation;
    for (const std::int64_t number :
         {std::int64_t{key.key.level}, key.key.x, key.key.y,
          std::int64_t{key.error_step} * 4 + (key.is_glb ? 2 : 0) + static_cast<int>(key.width)}) {
      hash = (hash ^ static_cast<std::uint64_t>(number)) * 0x9E3779B97F4A7C15;
      hash ^= hash >> 32;
    }
    return hash;
  }
};

class DrawnMeshCache : public ByteCache<DrawnMeshKey, DrawnMeshKeyHash, DrawnMesh> {
 public:
  using ByteCache::ByteCache;
};

// A mesh of the most vertices that a tile may have takes about 5 MB, one at the default error about 100 KB.
inline constexpr std::size_t kDrawnMeshBytes = std::size_t{32} << 20;

}  // namespace terrace::tiler
