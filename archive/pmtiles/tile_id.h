// PMTiles numbers tiles by level, and within a level along a Hilbert curve.
#pragma once

#include <cstdint>
#include <optional>

namespace terrace::archive {

struct PmtilesKey {
  int zoom = 0;
  std::uint64_t x = 0, y = 0;

  friend bool operator==(const PmtilesKey&, const PmtilesKey&) = default;
};

inline constexpr int kMaxZoom = 26;

// Precondition: 0 <= zoom <= kMaxZoom, x and y below 2^zoom.
std::uint64_t TileIdOf(const PmtilesKey& key);
// Nothing: the number is beyond kMaxZoom.
std::optional<PmtilesKey> KeyOf(std::uint64_t tile_id);

}  // namespace terrace::archive
