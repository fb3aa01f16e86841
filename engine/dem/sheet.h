// Heights of one raster at the nodes of any grid: positions, averaging, small voids, interpolation. Where it has
// nothing, nothing is said: other sheets and the floor are the dataset's business.
//
// Immutable and safe to use from many threads.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "engine/dem/grid_cells.h"
#include "engine/dem/raster_source.h"
#include "engine/geo/mercator_grid.h"

namespace terrace::dem {

// Heights that a tile can take from a sheet.
struct SheetRange {
  BlockRange blocks;         // min > max: none
  bool shows_others = true;  // part of the tile may lie outside the sheet or in its voids
  bool touches = false;
};

// What Fill saw of a window, for whoever wants to know how far its heights are from the samples.
struct SheetTrace {
  std::vector<Position> positions;         // by node, in pixels; NaN where there is none
  std::vector<std::int32_t> cell_of_node;  // in `cells`; -1: the node's height is not interpolated from this sheet
  std::vector<GridCell> cells;
  GridWindow window;
  std::vector<float> samples;  // of the window, averages by the factor, before voids were filled
  int factor = 1;
};

class Sheet {
 public:
  Sheet(std::shared_ptr<const RasterSource> raster, int max_void_gap);

  const RasterSource& raster() const { return *raster_; }
  const SourceSpacing& spacing() const { return raster_->spacing(); }
  const Georeference& georeference() const { return raster_->georeference(); }
  // Padded: outside it there is nothing.
  const Footprint& reach() const { return footprint_; }
  HeightRange heights() const { return raster_->info().heights; }  // of its samples
  // Of its pixels; columns without the duplicates of a sheet that goes all around the Earth.
  int columns() const { return raster_->layout().columns; }
  int rows() const { return raster_->layout().height; }
  bool wraps() const { return raster_->layout().wraps; }

  // At least the range of pixels in a box, clipped to the sheet.
  BlockRange Ranges(double west, double north, double east, double south) const {
    return raster_->ranges().Query(west, north, east, south);
  }
  // How far samples in a box of pixels are from the surface between averages (averaging_errors.h).
  float AveragingError(int factor, double west, double north, double east, double south) const {
    return raster_->averaging_errors().Largest(factor, west, north, east, south);
  }

  // These replace the NaN among `heights`, one for each node of the window, by the sheet's heights there, as far as it
  // has some. A height is a function of the node alone. kUnavailable: a raster cannot be read now. kCancelled: stopped.
  Result<void> Fill(const geo::Lattice& lattice, const NodeWindow& window, std::span<float> heights,
                    const std::stop_token& stop, SheetTrace* trace = nullptr) const;
  Result<void> Fill(const geo::MercatorGrid& grid, const NodeWindow& window, std::span<float> heights,
                    const std::stop_token& stop) const;

  // The same at single points, as measured: nothing is averaged and nothing is filled.
  Result<void> FillPoints(std::span<const GeoPosition> points, std::span<float> heights,
                          const std::stop_token& stop) const;

  // At least the heights that Fill gives to nodes of the tile, its edges included.
  SheetRange RangeOf(const geo::Lattice& lattice, const geo::TileKey& key) const;

 private:
  bool IsInside(const Position& position) const;
  // Of a pole row, where columns are meridians: they meet there in one value.
  std::optional<float> PoleHeight(const geo::Lattice& lattice, std::int64_t row) const;
  Result<std::vector<float>> ReadFilled(int factor, const GridWindow& window, const std::stop_token& stop,
                                        SheetTrace* trace) const;
  Result<void> FillAt(std::span<const Position> positions, int factor, std::span<float> heights,
                      const std::stop_token& stop, SheetTrace* trace) const;

  std::shared_ptr<const RasterSource> raster_;
  Footprint footprint_;                               // padded: outside it there is nothing
  int max_void_gap_;                                  // samples
  std::array<std::optional<float>, 2> pole_heights_;  // south, north: of geographic sheets that reach them
};

// Heights are multiples of 2^-10 m: libm's last bits, which differ between processors, end here.
float RoundHeight(double metres);

}  // namespace terrace::dem
