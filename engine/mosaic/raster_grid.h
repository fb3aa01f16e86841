// Rasters on one pixel grid, read as one raster at the nodes of any grid: positions, averaging, void filling,
// interpolation. Nodes without data stay NaN; the dataset fills them from other raster grids or the floor.
//
// Averages are taken over blocks of factor x factor pixels, counted from the raster grid's north-western corner. Where
// members overlap, a block of min(factor, alignment()) pixels is taken from the member with the most pixels in it,
// among equals from the first in members(). Members whose block is void are skipped. Immutable; safe to use from many
// threads.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/common/box_index.h"
#include "engine/common/content_hash.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/crs/undulations.h"
#include "engine/geo/node_grid.h"
#include "engine/mosaic/grid_cover.h"
#include "engine/mosaic/grid_members.h"
#include "engine/mosaic/grid_voids.h"
#include "engine/mosaic/harmonic_fill.h"
#include "engine/mosaic/point_blocks.h"
#include "engine/raster/grid_cells.h"

namespace terrace::dem {

// Heights that a tile can take from a raster grid.
struct GridRange {
  BlockRange blocks;         // the lowest and highest height, and whether there are voids; min > max: no height
  bool shows_others = true;  // part of the tile may lie outside the raster grid or in its voids
};

// What FillNodes read for a window. The error bounds compare served heights with these samples. Heights in metres.
struct GridReading {
  // The cell of averages by `factor` that contains each node. Valid where `heights` is not NaN. Nodes far from the
  // raster grid may have no position.
  NodeCells cells;
  // Per node, the raster grid's interpolated height before blending; NaN where it has none. With blending, nodes that
  // another raster grid has filled also have one, if their cell lies in `window` and has a sample.
  std::vector<float> heights;
  std::vector<double> undulations;  // per node, metres, included in `heights`; empty: no geoid was applied
  GridWindow window;
  // Averages of the window by `factor`, row by row from the north, NaN for voids. Narrow voids are filled only if
  // `includes_filled`.
  std::vector<float> samples;
  bool includes_filled = false;  // true when raster grids are blended at factor 1
  std::vector<float> weights;    // blend weights of `samples`, 0 to 1, if `includes_filled`; empty: all are 1
  int factor = 1;
};

struct GridOptions {
  int max_void_gap = 0;  // samples: narrower voids are filled
  HoleFill holes = HoleFill::kSmooth;
  // Width in metres of the blend into the raster grids below, inwards from edges and voids; 0: no blend.
  double feather_m = 0;
};

// Heights of a window's nodes in metres, one per node. Raster grids fill them one after the other.
struct NodeHeights {
  std::span<float> heights;  // NaN: none yet
  // Blend weights of the heights that have been written, greater than 0, up to 1; the raster grids below have the rest.
  // Empty: all 1.
  std::span<float> weights = {};
  // Smooth surface for holes where no raster grid has a height. NaN: none yet. Null: not wanted. Empty: no node has one
  // yet.
  std::vector<float>* hole_heights = nullptr;
  bool are_void = false;  // all heights are NaN
};

class RasterGrid {
 public:
  // Precondition: the plan has members.
  static Result<RasterGrid> Make(GridPlan plan, const GridOptions& options);

  const std::vector<GridMember>& members() const { return members_; }
  // Whether voids along the rim of a member are part of a hole. False with HoleFill::kFloor.
  bool HasPartOfHole(std::size_t member) const {
    return std::ranges::find(voids_.HoleRegions(member), 1) != voids_.HoleRegions(member).end();
  }
  // Returns the indices of the members that meet a box of pixels, ascending. Box::min_y is its first row.
  std::vector<std::size_t> MembersAt(const Box& pixels) const { return member_index_.Find(pixels); }
  const Georeference& georeference() const { return georeference_; }
  // Size in pixels. A raster grid that spans 360 degrees counts duplicated columns once.
  int columns() const { return columns_; }
  int rows() const { return height_; }
  bool wraps() const { return wraps_; }
  // Largest power of two up to 2^22, in pixels, that divides the first column and row of every member, and columns()
  // if the raster grid wraps.
  int alignment() const { return alignment_; }
  const SourceSpacing& spacing() const { return spacing_; }
  // Padded footprint in degrees. The raster grid has no pixels outside it.
  const Footprint& reach() const { return reach_; }
  // Heights in metres at the south and the north pole, in vertical(). Set only if columns are meridians and reach it.
  const std::array<std::optional<float>, 2>& pole_heights() const { return pole_heights_; }
  // Vertical datum of the samples.
  const VerticalDatum& vertical() const { return members_.front().raster->vertical(); }
  const Undulations* undulations() const { return undulations_.get(); }  // null: no geoid is applied
  const GridOptions& options() const { return options_; }

  SampleCounts CountSamples() const { return {counts_->measured, counts_->filled, counts_->voids}; }

  // Range of all samples, metres in vertical().
  const HeightRange& heights() const { return heights_; }
  // Returns bounds on the ellipsoidal heights of all samples, in metres.
  HeightRange EllipsoidalRange() const;

  // Replaces NaN among the window's heights by the raster grid's heights, where it has them. A height depends on the
  // node alone, not on the window. Fills in `reading` unless it is null. Errors: kUnavailable (a raster cannot be read
  // now), kChanged (a file was changed, replaced or removed), kCancelled (stopped).
  Result<void> FillNodes(const geo::NodeGrid& node_grid, const NodeWindow& window, HeightDatum datum,
                         const NodeHeights& nodes, const std::stop_token& stop, GridReading* reading = nullptr) const;

  // Returns the cells in which FillNodes locates the window's nodes. Where columns wrap, they are moved by whole turns
  // to lie near `samples`, the window of a GridReading.
  NodeCells CellsOf(const geo::Lattice& lattice, const NodeWindow& window, int factor, const GridWindow& samples) const;

  // FillNodes for single points, at full resolution. `filled`, one per point, becomes 1 where the point's pixel is
  // void, for points that get a height. Precondition: `nodes.hole_heights` has one entry per point. Errors: those of
  // FillNodes and of the geoid for `datum`.
  Result<void> FillPoints(std::span<const GeoPosition> points, HeightDatum datum, const NodeHeights& nodes,
                          std::span<std::uint8_t> filled, const std::stop_token& stop) const;

  // Whether a position lies in a member, the condition for a height from FillPoints. With wrapping: columns 0 ..
  // columns().
  bool Covers(const Position& pixel) const { return cover_.Inside(std::span(&pixel, 1))[0] != 0; }

  // Returns the block of cells with these numbers (PointBlockKey), and keeps it. Does not check whether the files are
  // unchanged if the block was kept. Errors: those of FillNodes.
  Result<PointBlockPtr> FindPointBlock(std::int64_t block_column, std::int64_t block_row,
                                       const std::stop_token& stop) const;

  // Returns the samples of a window, metres in vertical(), NaN for voids, row by row from the north. On a raster grid
  // that wraps, columns are taken modulo columns(). Errors: those of FillNodes.
  Result<std::vector<float>> ReadSamples(const GridWindow& window, const std::stop_token& stop) const {
    return ReadAverages(1, window, stop);
  }

  // Whether, at this factor or a smaller one, averages in a box of pixels may have a blend weight below 1: an edge or a
  // void lies within the feather width of the box.
  bool MayBlend(const Box& pixels, int factor) const;

  // Returns the range of the pixels in a box. Pixels that no member covers are voids.
  BlockRange Ranges(const Box& pixels) const;

  // The holes that meet `pixels` are filled from the heights around them. Returns a box that contains all of these
  // heights; nothing if no hole meets `pixels`.
  std::optional<Box> BoxAroundHoles(const Box& pixels, int factor) const;

  // Adds to a hash what heights depend on besides the georeference, the vertical datum, and the members' samples and
  // positions.
  void AddTo(ContentHasher& hasher) const;
  // Returns, ascending, the indices of all members that may affect RangeOf or the heights of `top`, or the heights of
  // the tiles below it down to level `deepest`; perhaps further members. `lattices`: by level.
  std::vector<std::size_t> MembersBelow(const geo::TileKey& top, const std::vector<geo::Lattice>& lattices,
                                        int deepest) const;
  // Which voids of a member are holes, by region.
  std::span<const std::uint8_t> HoleRegions(std::size_t member) const { return voids_.HoleRegions(member); }

  // Returns bounds on the ellipsoidal heights that FillNodes gives to the tile's nodes, edges included, in metres.
  GridRange RangeOf(const geo::Lattice& lattice, const geo::TileKey& key) const;

 private:
  explicit RasterGrid(Georeference where) : georeference_(std::move(where)) {}

  GridAxis Columns(int factor) const { return {columns_, factor, wraps_}; }
  GridAxis Rows(int factor) const { return {height_, factor, false}; }
  GridAxes Axes(int factor) const { return {Columns(factor), Rows(factor), width_, height_}; }
  void IndexMembers();
  void MeasureMembers();
  void FindPoleHeights();

  // Ranges of a box between column 0 and the last one, if columns wrap.
  BlockRange RangesInTurn(const Box& pixels) const;
  // Averages of the valid samples of each block (grid_blocks.cc); NaN where there is none.
  Result<std::vector<float>> ReadAverages(int factor, const GridWindow& window, const std::stop_token& stop) const;
  // Averages of `step` x `step` samples each, into rows of `out` that are `window.columns` wide. Precondition: every
  // member begins at a block; the window does not wrap.
  Result<void> Compose(int step, const GridWindow& window, float* out, const std::stop_token& stop) const;
  // A window with narrow voids filled.
  struct Bridged {
    std::vector<float> heights;
    std::uint64_t voids = 0;  // before
  };
  // `measured`: unless null, becomes the window before filling; is not changed if there are no voids.
  Result<Bridged> ReadBridged(int factor, const GridWindow& window, const std::stop_token& stop,
                              std::vector<float>* measured = nullptr) const;
  // ReadAverages of `wide`, a part of which was read before: `known`, of the window `core`.
  Result<std::vector<float>> ReadWithKnown(int factor, const GridWindow& wide, const GridWindow& core,
                                           const std::vector<float>& known, const std::stop_token& stop) const;
  // The window of ReadBridged with smooth surfaces in the holes that are left (grid_holes.cc); empty where there are
  // none. Precondition: `bridged` is what ReadBridged gives.
  Result<std::vector<float>> FillHoles(int factor, const GridWindow& window, const Bridged& bridged,
                                       const std::stop_token& stop) const;
  // `is_guess`: the result is the first guess for the same holes by the next finer factor (GuessLarge). Averages beside
  // a hole then count as part of the hole.
  Result<std::vector<float>> ReadSmooth(int factor, const GridWindow& window, bool is_guess,
                                        const std::stop_token& stop) const;
  Result<WindowWithHoles> ReadWithHoles(int factor, const GridWindow& window, bool is_guess,
                                        const std::stop_token& stop) const;
  Result<void> GuessLarge(int factor, const GridWindow& window, const std::vector<VoidRegion>& regions,
                          WindowWithHoles& grid, const std::stop_token& stop) const;
  GridWindow Grown(const GridWindow& window, int halo, int factor) const;
  Result<PointBlock> ReadPointBlock(const GridWindow& window, const std::stop_token& stop) const;
  GridWindow WindowOfPointBlock(std::int64_t block_column, std::int64_t block_row) const;
  Result<PointBlockPtr> BlockOfCells(std::vector<GridCell>& cells, const std::stop_token& stop) const;

  // Whether the statistics say that a window of averages is void, and nothing fills it. False does not mean the
  // contrary.
  bool IsUnfilledVoid(int factor, const GridWindow& window) const;
  // Returns the pixel positions of the window's nodes for averages by `factor`.
  NodePositions PositionsOf(const geo::NodeGrid& node_grid, const NodeWindow& window, int factor) const;
  // `inside`: one entry per node, 0 where it gets no height. `undulations`: one per node, added to heights; empty:
  // none are.
  Result<void> FillNodesAt(NodePositions positions, std::span<const std::uint8_t> inside,
                           std::span<const double> undulations, int factor, const NodeHeights& nodes,
                           const std::stop_token& stop, GridReading* reading = nullptr) const;
  // Sets the heights of `reading` at nodes that other raster grids have filled (`others`: 1), as far as the samples of
  // this grid were read there.
  void AddReadingsOfOthers(std::span<const std::uint8_t> others, const std::vector<float>& bridged,
                           const std::vector<float>& filled, std::span<const double> undulations,
                           GridReading& reading) const;
  std::optional<float> PoleHeight(int pole, HeightDatum datum) const;  // 0 south, 1 north
  // Returns the blend weight of each sample in the window, 0 to 1; empty: all are 1.
  Result<std::vector<float>> ReadWeights(int factor, const GridWindow& window, const std::stop_token& stop) const;
  // Feather width in metres, at most 256 samples by `factor`.
  double Feather(int factor) const;
  // For calls that read no sample: checks that the file is unchanged if the raster grid has a single member.
  Result<void> CheckUnchanged() const;
  Result<void> CheckMembersUnchanged(int factor, const GridWindow& window) const;

  struct Counts {
    std::atomic<std::uint64_t> measured{0}, filled{0}, voids{0};
  };

  static std::uint64_t NextId();

  std::uint64_t id_ = NextId();  // of its blocks in PointBlockCache
  Georeference georeference_;
  std::shared_ptr<const Undulations> undulations_;  // null: heights are ellipsoidal, or taken as such
  std::shared_ptr<Counts> counts_ = std::make_shared<Counts>();
  int width_ = 0, height_ = 0;
  int columns_ = 0;  // without the duplicated columns of a raster grid that spans 360 degrees
  bool wraps_ = false;
  SourceSpacing spacing_;
  Footprint reach_;
  GridOptions options_;
  std::array<std::optional<float>, 2> pole_heights_;
  GridVoids voids_;

  std::vector<GridMember> members_;
  HeightRange heights_;
  BoxIndex member_index_;  // by pixels; with wrapping also one turn west and one turn east
  GridCover cover_;
  int alignment_ = 1;  // the largest power of two at whose multiples all members begin
};

}  // namespace terrace::dem
