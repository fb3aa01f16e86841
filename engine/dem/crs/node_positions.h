// Where the samples of a tile lie in the source, in pixels.
#pragma once

#include <limits>
#include <vector>

#include "engine/dem/crs/footprint.h"
#include "engine/dem/crs/georeference.h"
#include "engine/dem/dem_types.h"
#include "engine/geo/lattice.h"
#include "engine/geo/mercator_grid.h"
#include "engine/geo/tile_key.h"

namespace terrace::dem {

// Of nodes that have no place in a raster: NaN.
inline constexpr Position kNowhere{std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()};

// The window of a tile: its samples and one more on each side.
NodeWindow WindowOfTile(const geo::Lattice& lattice, const geo::TileKey& key);

// Pixel positions of the window's nodes, row by row from its first; NaN where the source's CRS has none, and outside
// `footprint`. A position is a function of the global node alone: whichever window asks gets the same bits. All nodes
// of a pole row share one position.
//
// Exact for sources in WGS 84 degrees. Others are transformed at 5 x 5 nodes of global cells of 32 x 32 nodes and
// interpolated with the fourth degree within `tolerance` pixels; cells where that does not hold are divided.
std::vector<Position> NodePositions(const Georeference& georeference, const Footprint& footprint,
                                    const geo::Lattice& lattice, const NodeWindow& window, double tolerance);

// The same for the pixel centres of Web Mercator tiles.
std::vector<Position> NodePositions(const Georeference& georeference, const Footprint& footprint,
                                    const geo::MercatorGrid& grid, const NodeWindow& window, double tolerance);

// The same for the centres of the tile's cells x cells lattice cells, without a halo: where the pixels of an image of
// the tile are sampled.
std::vector<Position> CellCentrePositions(const Georeference& georeference, const Footprint& footprint,
                                          const geo::Lattice& lattice, const geo::TileKey& key, double tolerance);

}  // namespace terrace::dem
