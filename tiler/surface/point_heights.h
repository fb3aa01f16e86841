// Heights at points, of sources or of drawn surfaces.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::tiler {

// Heights of a dataset at points. NaN in holes that edits cut. Where neither a source nor an edit has a height: NaN in
// heights of the sources (ElevationModel::ReadPoints), the floor in heights of a drawn surface.
struct PointHeights {
  std::vector<float> heights;
  std::vector<std::uint8_t> filled = {};           // by point: 1 where a void was filled; empty for a drawn surface
  std::vector<std::array<float, 3>> normals = {};  // by point: unit, east, north, up; empty: not wanted
  // Of drawn surfaces: the tiles that were read, and the index of each point's tile. Empty: heights of the sources.
  std::vector<geo::TileKey> tiles = {};
  std::vector<std::uint32_t> tile_of_point = {};
};

}  // namespace terrace::tiler
