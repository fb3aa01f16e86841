// The quadtree of the TMS "global-geodetic" scheme (EPSG:4326): two roots, 180 degrees wide.
// Axis order: x counts from the WEST (-180), y counts from the SOUTH (-90). Level z has 2^(z+1) columns
// and 2^z rows of tiles that are 180 / 2^z degrees wide and high.
#pragma once

#include <cstdint>
#include <string>

namespace terrace::geo {

inline constexpr int kMaxLevel = 24;  // a tile of level 24 is 1.2 m wide; x and y stay far below 2^31

struct TileKey {
  int level = 0;
  std::int64_t x = 0;
  std::int64_t y = 0;

  friend bool operator==(const TileKey&, const TileKey&) = default;
};

constexpr std::int64_t TileColumns(int level) { return std::int64_t{2} << level; }
constexpr std::int64_t TileRows(int level) { return std::int64_t{1} << level; }

// 0 <= level <= kMaxLevel, x and y inside the level.
constexpr bool IsValid(const TileKey& key) {
  return key.level >= 0 && key.level <= kMaxLevel && key.x >= 0 && key.x < TileColumns(key.level) && key.y >= 0 &&
         key.y < TileRows(key.level);
}

// Returns the tile `dx` columns to the east (modulo 360 degrees) and `dy` rows to the north; y may lie outside the
// level.
TileKey Neighbour(const TileKey& key, int dx, int dy);

// "9/533/388"
std::string ToString(const TileKey& key);

// An inclusive block of tiles of one level.
struct TileRange {
  std::int64_t start_x = 0;
  std::int64_t start_y = 0;
  std::int64_t end_x = -1;
  std::int64_t end_y = -1;

  bool Contains(const TileKey& key) const {
    return key.x >= start_x && key.x <= end_x && key.y >= start_y && key.y <= end_y;
  }
  friend bool operator==(const TileRange&, const TileRange&) = default;
};

}  // namespace terrace::geo
