// The height fields that are measured: real elevation models, and one that is part of the repository.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "engine/tin/mesh/height_field.h"

namespace terrace::bench {

struct Window {
  int x = 0, y = 0, width = 0, height = 0;  // samples; width 0: all of the raster
};

// A window of a raster of the test data (tests/support/test_data.h) or of config/samples. Voids are bridged from their
// rims where these are near and 0 otherwise, so that programs without a notion of voids get the same heights. Nothing
// when the file is missing; says so on stderr, once for each file.
std::optional<tin::HeightField> ReadField(const std::string& name, const Window& window = {});

// Where the tiles that are measured lie: rough mountains at 3 arc-seconds, in windows with few voids, and two of the
// paper's elevation models.
struct Area {
  const char* name;
  const char* file;
  std::vector<std::pair<int, int>> corners;  // of windows of kTileSide x kTileSide samples
};
inline constexpr int kTileSide = 257;
std::span<const Area> TileAreas();

// All tiles of the area; nothing when its file is missing.
std::optional<std::vector<tin::HeightField>> ReadTiles(const Area& area);

// The elevation models of the test data that hold a tile, from mountains to plains and from 1 m to 18 km a sample, each
// with the tiles around the centres of its four quarters. One with less than a metre of relief is left out: the sea.
// Nothing where none is left, or the file is missing or too small.
std::span<const char* const> TileRasters();
std::optional<std::vector<tin::HeightField>> ReadQuarterTiles(const char* file);

// Rasters to be meshed whole, the first of them part of the repository.
struct LargeRaster {
  const char* name;
  const char* file;
  Window window;
  bool is_mirrored;  // MirroredFourfold
};
std::span<const LargeRaster> LargeRasters();
std::optional<tin::HeightField> ReadLarge(const LargeRaster& raster);

// The field, its mirror image to the east of it, and both of them mirrored to the north: four times the land with no
// seam between.
tin::HeightField MirroredFourfold(const tin::HeightField& field);

}  // namespace terrace::bench
