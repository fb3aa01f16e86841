// A binary .subtree of 3D Tiles 1.1 implicit tiling: which tiles of a quadtree exist, a few levels at a time
// (OGC 22-025r4, "Implicit Tiling", sections "Subtrees" and "Subtree Binary Format").
//
// Bits come in level order and in Morton order within a level (x in the even bits), least significant bit first.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"
#include "proto/height_span.h"

namespace terrace::proto {

inline constexpr int kMaxSubtreeLevels = 10;  // 350,000 tiles; clients create an object for each when the file arrives

// Names of the metadata in a subtree: the class and its properties in the tileset's schema.
inline constexpr const char* kTileClass = "tile";
inline constexpr const char* kMinHeightProperty = "min_height";
inline constexpr const char* kMaxHeightProperty = "max_height";

struct Subtree {
  int levels = 1;  // 1 .. kMaxSubtreeLevels
  // Entry k, 0 .. levels: blocks without overlap of the available tiles k levels below the subtree's root, numbered
  // from its south-western corner. Entry `levels` holds the roots of child subtrees.
  std::vector<std::vector<geo::TileRange>> tiles;
  // The heights of the tile {k, x, y}, k levels below the root, numbered in the same way. They are multiples of 2^-8 m
  // below 2^16 m, which floats represent exactly. Each range is widened to contain those of the tiles below it in this
  // subtree. Empty: no metadata.
  std::function<HeightSpan(const geo::TileKey&)> heights;
};

// The whole file. Every available tile has content and a row of metadata. If all bits of a bitstream are equal, the
// JSON has a constant instead of the bitstream. Preconditions: tiles has levels + 1 entries, the root is available, and
// so is the parent of every available tile.
std::string EncodeSubtree(const Subtree& subtree);

// Returns the index of tile (x, y) in the Morton order of its level. Precondition: x and y are below 2^16.
std::uint32_t MortonIndex(std::uint32_t x, std::uint32_t y);

}  // namespace terrace::proto
