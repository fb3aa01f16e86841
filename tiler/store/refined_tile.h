// Heights and refinement of a tile. Quantized-mesh and GLB tiles of every error and coding are meshed from these; only
// water masks and textures are read besides.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "engine/dem/elevation_model.h"
#include "engine/geo/tile_key.h"
#include "engine/tin/refinement.h"
#include "tiler/store/tile_selection.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

struct RefinedTile {
  dem::TileHeights heights;
  std::optional<tin::Refinement> refinement;  // none: the run was too large for one
  double error_m = 0;                         // the smallest error that the refinement serves
};

inline std::size_t BytesOf(const RefinedTile& tile) {
  return sizeof(RefinedTile) + tile.heights.heights.capacity() * sizeof(float) +
         (tile.refinement ? tile.refinement->bytes() : 0);
}

using RefinedTilePtr = std::shared_ptr<const RefinedTile>;

struct RefinedTileKey {
  std::uint64_t generation = 0;  // Dataset::cache_generation: identifies the dataset
  geo::TileKey key;
  std::uint64_t edits = 0;  // dem::TileEdits::Hash

  friend bool operator==(const RefinedTileKey&, const RefinedTileKey&) = default;
};

struct RefinedTileKeyHash {
  std::size_t operator()(const RefinedTileKey& key) const noexcept {
    TileRequest request;
    request.key = key.key;
    return TileRequestHash{}(request) ^ static_cast<std::size_t>(key.generation ^ key.edits);
  }
};

inline bool IsSelected(const TileSelection& selection, const RefinedTileKey& key) {
  return selection.Contains(key.generation, key.key, /*is_mercator=*/false);
}

}  // namespace terrace::tiler
