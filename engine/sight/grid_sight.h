// Measures the clearance of rays above the surface that is bilinear between the samples of a raster grid.
//
// Branch and bound. A part of a ray is skipped if its clearance above the largest height below it is not less than the
// smallest clearance found so far. Other parts are halved. A part within one block and without voids is walked in runs
// of eight and of four steps, then step by step: runs are compared with the largest corners of the cells around them,
// steps also with the surface. Within a cell that may have the minimum, the clearance between lines of the grid is a
// polynomial of the second degree, so its minimum is exact.
#pragma once

#include <map>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/sight/sight_block.h"
#include "engine/sight/sight_ray.h"
#include "engine/sight/sight_search.h"
#include "engine/sight/sight_track.h"

namespace terrace::dem {

// A part of a ray, as shares of its length.
struct RayPart {
  double start = 0, end = 1;
};

// Which heights of a raster grid count.
enum class SightSurface : std::uint8_t {
  kAll,       // measured, filled, and smooth ones in holes
  kNotHoles,  // without the smooth heights in holes, because a height of another raster grid comes before these
};

// One raster grid and the rays over it. For one thread.
class GridSight {
 public:
  explicit GridSight(const RasterGrid& grid) : grid_(grid), blocks_(grid) {}

  // Measures the parts of a ray, in order. Returns the parts above places where the raster grid has no height.
  // `pieces`: of the ray. Errors: those of RasterGrid::FindPointBlock.
  Result<std::vector<RayPart>> Search(std::span<const TrackPiece> pieces, std::span<const RayPart> parts,
                                      SightSurface surface, SightSearch& search, const std::stop_token& stop);

  std::size_t blocks() const { return blocks_.size(); }  // in memory

 private:
  struct Scan;
  struct CellRange {
    std::int64_t west, north, east, south;
  };

  Result<void> Probe(Scan& scan);
  Result<void> Halve(Scan& scan, double first, double last);
  Result<void> Walk(Scan& scan, const SightBlock& block, const CellRange& cells, double turn, double first, double last,
                    double size);
  Result<void> Measure(Scan& scan, double first, double last);
  Result<void> MeasureInCell(Scan& scan, double first, double last);
  void MeasureRim(Scan& scan, const SightBlock& block, std::int64_t column, std::int64_t row, double first, double last,
                  bool is_settled);
  bool IsInside(const Scan& scan, double s) const;
  std::int64_t WrappedColumn(std::int64_t column) const;
  CellRange CellsOf(const Quadratic::Range& x, const Quadratic::Range& y) const;

  const RasterGrid& grid_;
  SightBlocks blocks_;
};

// The raster grids below the rays of a request. All grids but the one in use together keep at most kMaxSightBlocks
// blocks; the one in use keeps at most as many. For one thread.
class GridSights {
 public:
  // `number`: of the grid. The reference is valid until the next call.
  GridSight& Of(std::size_t number, const RasterGrid& grid);
  std::size_t blocks() const;  // in memory

 private:
  std::map<std::size_t, GridSight> sights_;
};

}  // namespace terrace::dem
