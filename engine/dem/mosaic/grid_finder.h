// Finds rasters that lie on one pixel grid, by reference system, vertical datum, pixel size and offset.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "engine/dem/crs/georeference.h"
#include "engine/dem/crs/vertical_datum.h"

namespace terrace::dem {

// The georeference and vertical datum of a raster. Both must outlive the users of this struct.
struct PlacedRaster {
  const Georeference* where = nullptr;
  const VerticalDatum* vertical = nullptr;
};

// Offsets within a tolerance count as whole pixels (Georeference::OffsetOf), so a raster may fit several grids. It then
// belongs to the first of them, in the order in which grids were added. A look-up takes constant time if pixel sizes
// are bit-equal; else its time grows with the number of different pixel sizes.
class GridFinder {
 public:
  struct Membership {
    std::size_t grid = 0;  // grids are numbered from 0; the next number is a new grid
    PixelOffset offset;    // of the raster's first pixel from that of the grid's first raster
  };

  // Returns the raster's grid. A raster that fits no grid begins a new one.
  Membership Add(const PlacedRaster& raster);

  // Grids that rasters were compared with so far. For tests: this grows linearly with the number of rasters.
  std::size_t grids_compared() const { return grids_compared_; }

 private:
  // Bucket of an offset's fraction of a pixel.
  using Phase = std::uint32_t;

  // Grids whose pixels are bit-equal except for the offset. Their numbers are ascending.
  struct Family {
    const Georeference* first = nullptr;
    std::vector<std::size_t> grids;
    std::unordered_map<Phase, std::vector<std::size_t>> by_phase;
    std::vector<std::size_t> far;  // too far away for a phase
  };
  // Families with the same reference system and vertical datum, in the order in which they were added.
  struct Kind {
    const VerticalDatum* vertical = nullptr;
    std::vector<Family> families;
    std::map<std::array<double, 4>, std::size_t> by_pixel;
  };

  Kind& KindOf(const PlacedRaster& raster);
  std::vector<std::size_t> Candidates(const Family& family, const Georeference& where) const;
  void Keep(Kind& kind, const Georeference& where, std::size_t grid);

  std::vector<const Georeference*> grids_;                         // their first rasters
  std::unordered_map<std::string_view, std::vector<Kind>> kinds_;  // by the reference system
  std::size_t grids_compared_ = 0;
};

}  // namespace terrace::dem
