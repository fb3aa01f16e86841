// Rasters on one pixel grid, read as if they were one, at the nodes of any grid: positions, averaging, voids,
// interpolation. Where they have nothing, nothing is said: other raster grids and the floor are the dataset's business.
//
// Averages are those of blocks of pixels counted from the raster grid's north-western corner. Of rasters that overlap
// the first has its say; where it is void, the next. Immutable and safe to use from many threads.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/common/box_index.h"
#include "engine/dem/crs/undulations.h"
#include "engine/dem/dem_types.h"
#include "engine/dem/mosaic/grid_members.h"
#include "engine/dem/mosaic/grid_voids.h"
#include "engine/dem/mosaic/membrane.h"
#include "engine/dem/raster/grid_cells.h"
#include "engine/geo/mercator_grid.h"

namespace terrace::dem {

// Heights that a tile can take from a raster grid.
struct GridRange {
  BlockRange blocks;         // min > max: none
  bool shows_others = true;  // part of the tile may lie outside the raster grid or in its voids
};

// What Fill saw of a window, for whoever wants to know how far its heights are from the samples.
struct GridTrace {
  std::vector<Position> positions;  // by node, in pixels; NaN where there is none
  bool is_part = false;             // nodes far from the raster grid were not asked about: NaN as well
  // In `cells`; -1: the raster grid has no interpolated height for the node. Where raster grids are blended, nodes that
  // others fill have theirs too, as far as what was read tells it.
  std::vector<std::int32_t> cell_of_node;
  std::vector<float> heights;       // by node: the raster grid's own, whatever it counts; NaN where it has none
  std::vector<double> undulations;  // by node, part of the heights; empty where they count as the samples do
  std::vector<GridCell> cells;
  GridWindow window;
  // Of the window, averages by the factor, before voids were filled; small ones are where `includes_filled`.
  std::vector<float> samples;
  bool includes_filled = false;  // where raster grids are blended at the full resolution what was bridged has its share
  std::vector<float> weights;    // then, of the samples; empty: all count in full
  int factor = 1;
};

struct GridOptions {
  int max_void_gap = 0;  // samples: narrower voids are filled
  HoleFill voids = HoleFill::kSmooth;
  double feather_m =
      0;  // how far from its edges and voids a raster grid begins to give way to what lies below; 0: at them
};

// Heights of a window's nodes, one each, while raster grids fill them in.
struct NodeHeights {
  std::span<float> heights;  // NaN: still wanted
  // What those that are filled in count beside what lies below, over 0 to 1. Empty: in full.
  std::span<float> weights = {};
  // What is drawn in holes that no raster grid has a height for. NaN: not known so far. Empty: not wanted.
  std::span<float> smooth = {};
};

class RasterGrid {
 public:
  // Precondition: the plan has members.
  static Result<RasterGrid> Make(GridPlan plan, const GridOptions& options);

  const std::vector<GridMember>& members() const { return members_; }
  // Those that meet a box of pixels; Box::south is its first row.
  std::vector<std::size_t> MembersAt(const Box& pixels) const { return member_index_.Find(pixels); }
  const Georeference& georeference() const { return georeference_; }
  // Of its pixels; columns without the duplicates of a raster grid that goes all around the Earth.
  int columns() const { return columns_; }
  int rows() const { return height_; }
  bool wraps() const { return wraps_; }
  // The largest power of two at whose multiples all members begin.
  int alignment() const { return alignment_; }
  const SourceSpacing& spacing() const { return spacing_; }
  // Padded: outside it there is nothing.
  const Footprint& reach() const { return reach_; }
  // South, north: heights at the poles, of raster grids whose columns are meridians and that reach them.
  const std::array<std::optional<float>, 2>& pole_heights() const { return pole_heights_; }  // as counted
  // What its samples count from.
  const VerticalDatum& vertical() const { return members_.front().raster->vertical(); }
  const Undulations* undulations() const { return undulations_.get(); }  // null: none are added
  const GridOptions& options() const { return options_; }

  SampleCounts CountSamples() const { return {counts_->measured, counts_->filled, counts_->voids}; }

  // Of all its samples, as they count.
  const HeightRange& heights() const { return heights_; }
  // At least the ellipsoidal heights of all its samples.
  HeightRange EllipsoidalRange() const;

  // These replace the NaN among the heights of a window's nodes by the raster grid's, as far as it has some. A height
  // is a function of the node alone. kUnavailable: a raster cannot be read now. kCancelled: stopped. `trace` is filled
  // in, unless it is null.
  Result<void> Fill(const geo::Lattice& lattice, const NodeWindow& window, HeightDatum datum, const NodeHeights& nodes,
                    const std::stop_token& stop, GridTrace* trace = nullptr) const;
  Result<void> Fill(const geo::MercatorGrid& grid, const NodeWindow& window, const NodeHeights& nodes,
                    const std::stop_token& stop) const;

  // Pixel positions of the window's nodes as Fill finds them for averages by `factor`.
  std::vector<Position> PositionsOf(const geo::Lattice& lattice, const NodeWindow& window, int factor) const;

  // The same at single points, of the full resolution. `filled`, one for each of them: becomes 1 where the sample whose
  // pixel holds the point is void.
  Result<void> FillPoints(std::span<const GeoPosition> points, HeightDatum datum, const NodeHeights& nodes,
                          std::span<std::uint8_t> filled, const std::stop_token& stop) const;

  // As measured, NaN for voids, row by row from the north. Columns outside the raster grid are a turn on, of raster
  // grids that wrap.
  Result<std::vector<float>> ReadSamples(const GridWindow& window, const std::stop_token& stop) const {
    return ReadBlocks(1, window, stop);
  }

  // Whether its samples in a box of pixels may count less than in full when they are averaged by this factor or a
  // smaller one: an edge or a void is as near as the feather is wide.
  bool GivesWay(const Box& pixels, int factor) const;

  // Of the pixels in a box; what no member covers counts as void.
  BlockRange Ranges(const Box& pixels) const;

  // Of the pixels around the holes that meet a box, from which those are filled; nothing where there are none.
  BlockRange RangeAroundHoles(const Box& pixels, int factor) const;

  // At least the heights that Fill gives to nodes of the tile, its edges included.
  GridRange RangeOf(const geo::Lattice& lattice, const geo::TileKey& key) const;

 private:
  explicit RasterGrid(Georeference where) : georeference_(std::move(where)) {}

  GridAxis Columns(int factor) const { return {columns_, factor, wraps_}; }
  GridAxis Rows(int factor) const { return {height_, factor, false}; }
  void IndexMembers();
  void MeasureMembers();
  void FindPoleHeights();

  // A cell for each position inside the raster grid whose height is NaN, and which it is.
  struct Cells {
    std::vector<GridCell> cells;
    std::vector<std::size_t> nodes;
  };
  Cells CellsAt(std::span<const Position> positions, std::size_t stride, std::span<const float> heights,
                int factor) const;

  // Averages of the valid samples of each block; NaN where there is none.
  Result<std::vector<float>> ReadBlocks(int factor, const GridWindow& window, const std::stop_token& stop) const;
  // Averages of `step` x `step` samples each, into rows of `out` that are `window.columns` wide. Precondition: every
  // member begins at a block; the window does not wrap.
  Result<void> Compose(int step, const GridWindow& window, std::span<float> out, const std::stop_token& stop) const;
  Result<void> Average(int factor, const GridWindow& window, float* out, std::int64_t stride,
                       const std::stop_token& stop) const;
  // Small voids filled in. `measured`: becomes what was there before, unless it is null.
  struct Bridged {
    std::vector<float> heights;
    std::uint64_t voids = 0;  // before
  };
  Result<Bridged> ReadBridged(int factor, const GridWindow& window, const std::stop_token& stop,
                              std::vector<float>* measured = nullptr) const;
  // The same with smooth surfaces in the holes that are left (grid_holes.cc); empty where there are none.
  // Precondition: `bridged` is what ReadBridged gives.
  Result<std::vector<float>> FillHoles(int factor, const GridWindow& window, const Bridged& bridged,
                                       const std::stop_token& stop) const;
  Result<std::vector<float>> ReadSmooth(int factor, const GridWindow& window, bool is_guess,
                                        const std::stop_token& stop) const;
  Result<VoidGrid> ReadVoids(int factor, const GridWindow& window, bool is_guess, const std::stop_token& stop) const;
  Result<void> GuessLarge(int factor, const GridWindow& window, const std::vector<VoidRegion>& regions, VoidGrid& grid,
                          const std::stop_token& stop) const;
  GridWindow Grown(const GridWindow& window, int halo, int factor) const;

  // `undulations`: of the same nodes, added to heights; empty: none are.
  Result<void> FillAt(std::span<const Position> positions, std::size_t stride, std::span<const double> undulations,
                      int factor, const NodeHeights& nodes, const std::stop_token& stop,
                      GridTrace* trace = nullptr) const;
  void TraceOthers(const Cells& others, const std::vector<float>& bridged, const std::vector<float>& filled,
                   std::span<const double> undulations, GridTrace& trace) const;
  std::optional<float> PoleHeight(int pole, HeightDatum datum) const;  // 0 south, 1 north
  // What each sample of the window counts; empty: all count in full.
  Result<std::vector<float>> ReadWeights(int factor, const GridWindow& window, const std::stop_token& stop) const;
  // Metres: no more than a bounded number of samples.
  double Feather(int factor) const;
  Result<void> CheckUnread() const;

  struct Counts {
    std::atomic<std::uint64_t> measured{0}, filled{0}, voids{0};
  };

  Georeference georeference_;
  std::shared_ptr<const Undulations> undulations_;  // null: heights are ellipsoidal, or taken as such
  std::shared_ptr<Counts> counts_ = std::make_shared<Counts>();
  int width_ = 0, height_ = 0;
  int columns_ = 0;  // of them in use: without the duplicates of a raster that goes all around the Earth
  bool wraps_ = false;
  SourceSpacing spacing_;
  Footprint reach_;
  GridOptions options_;
  std::array<std::optional<float>, 2> pole_heights_;
  GridVoids voids_;

  std::vector<GridMember> members_;
  HeightRange heights_;
  BoxIndex member_index_;              // by pixels; of raster grids that wrap also a turn before and after
  std::vector<geo::TileRange> cover_;  // pixels that members have, without overlap
  BoxIndex cover_index_;
  int alignment_ = 1;  // the largest power of two at whose multiples all members begin
};

// Heights are multiples of 2^-10 m: libm's last bits, which differ between processors, end here.
float RoundHeight(double metres);

}  // namespace terrace::dem
