// Mapbox Vector Tiles 2.1 with one layer of lines (https://github.com/mapbox/vector-tile-spec), encoded with protozero.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace terrace::proto {

// Units along the edge of a tile.
inline constexpr int kVectorTileExtent = 4096;

struct TilePoint {
  std::int32_t x = 0, y = 0;  // from the north-western corner; y southwards

  friend bool operator==(const TilePoint&, const TilePoint&) = default;
};

// All lines of one height: one feature.
struct ContourFeature {
  double height_m = 0;
  bool is_index = false;
  std::vector<std::vector<TilePoint>> lines;  // each of at least two points, no two in a row equal
};

inline constexpr std::string_view kContourLayer = "contour";

// A tile with the layer "contour" and the attributes "ele" (an integer, or a double if it is not whole) and "index" (a
// bool). Features without lines are left out. Without features the tile is empty: no bytes.
std::string EncodeContourTile(const std::vector<ContourFeature>& features);

}  // namespace terrace::proto
