// The height fields of the benchmarks: real elevation models, and one that is part of the repository.
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

// A window of a raster of the test data (tests/support/test_data.h) or of config/samples. Voids are filled from their
// edges if these are near, and are 0 otherwise, so that programs that do not support voids get the same heights.
// Nothing if the file is missing, with a message on stderr once for each file.
std::optional<tin::HeightField> ReadField(const std::string& name, const Window& window = {});

// Areas of the measured tiles: rough mountains at 3 arc-seconds, in windows with few voids, and two of the paper's
// elevation models.
struct Area {
  const char* name;
  const char* file;
  std::vector<std::pair<int, int>> corners;  // of windows of kTileSide x kTileSide samples
};
inline constexpr int kTileSide = 257;
std::span<const Area> TileAreas();

// All tiles of the area; nothing if its file is missing.
std::optional<std::vector<tin::HeightField>> ReadTiles(const Area& area);

// The elevation models of the test data with at least one tile, from mountains to plains and from 1 m to 18 km a
// sample. Each has the tiles around the centres of its four quarters; tiles with less than a metre of relief are sea
// and left out. Nothing if no tile is left, or the file is missing or too small.
std::span<const char* const> TileRasters();
std::optional<std::vector<tin::HeightField>> ReadQuarterTiles(const char* file);

// Rasters that are meshed whole. The first one is part of the repository.
struct LargeRaster {
  const char* name;
  const char* file;
  Window window;
  bool is_mirrored;  // MirroredFourfold
};
std::span<const LargeRaster> LargeRasters();
std::optional<tin::HeightField> ReadLarge(const LargeRaster& raster);

// The field, its mirror image to the east, and both mirrored to the north: four times the area without a seam.
tin::HeightField MirroredFourfold(const tin::HeightField& field);

}  // namespace terrace::bench
