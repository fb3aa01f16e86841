// The units of a bake: "top" with the shallow levels, and one subtree for each tile of level archive::kTopLevels. Units
// are baked, retried, skipped and replaced as a whole.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::bake {

// Tiles by level, from 0, as ranges without overlap. A pyramid may have no tiles on its first levels.
using Pyramid = std::vector<std::vector<geo::TileRange>>;

// The number of tiles of all levels.
std::uint64_t CountTiles(const Pyramid& pyramid);

struct Unit {
  std::string name;                  // archive::UnitNameOf
  std::optional<geo::TileKey> root;  // nothing: the top unit
  Pyramid tiles;                     // of this unit
};

// Subtrees along the Z-order of their roots, so that neighbours follow each other; the top unit last. Units without
// tiles are left out.
std::vector<Unit> UnitsOf(const Pyramid& pyramid);

// A part of a unit: `root`, and the tiles below it on the levels up to `last_level`.
struct Part {
  geo::TileKey root;
  int last_level = 0;
};

// Divides a unit into parts for several threads. Together they have each tile once.
std::vector<Part> PartsOf(const Unit& unit);

// Calls `visit` for the tiles of a part in Z-order, each before its children, so that neighbours share decoded blocks
// of the sources. Returns false if `visit` did, which ends the walk.
bool Walk(const Pyramid& tiles, const Part& part, const std::function<bool(const geo::TileKey&)>& visit);

}  // namespace terrace::bake
