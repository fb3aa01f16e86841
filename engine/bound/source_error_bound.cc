#include "engine/bound/source_error_bound.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "engine/bound/cell_error_bound.h"
#include "engine/bound/geoid_error_bound.h"
#include "engine/bound/grid_statistics.h"
#include "engine/bound/smooth_error_bound.h"
#include "engine/common/dem_types.h"

namespace terrace::dem {
namespace {

// Cells with a loose bound, at joints of averaged rasters, at rims and beside voids. Reading their samples tightens it.
class LooseCells {
 public:
  // For larger factors the blocks of the statistics are as fine as the cells.
  static bool MayRead(int factor) { return factor > 1 && factor <= 16; }

  // The arguments must outlive this.
  LooseCells(const RasterGrid& grid, const CellErrorBound& single) : grid_(grid), single_(single) {}

  // `error`: the known bound of the cell. The samples of successive cells of one group are read together.
  void Add(const TileCell& cell, const CellErrorBound::CellSamples& cell_samples, double error) {
    constexpr int kGroup = SourceErrorBound::kGroup;
    const auto group_of = [](const TileCell& of) { return std::pair(of.i / kGroup, of.j / kGroup); };
    if (groups_.empty() || group_of(groups_.back().cells.front().cell) != group_of(cell)) groups_.emplace_back();
    groups_.back().cells.push_back({cell, cell_samples, error});
    groups_.back().error = std::max(groups_.back().error, error);
  }

  // Raises `bound` to the bound of all cells. Reads only groups that could raise it, and a bounded number of samples.
  Result<void> Read(double& bound, const std::stop_token& stop) {
    // Limit of samples for one tile and raster grid: about as many as the tile's heights are averaged from at the
    // largest factor of MayRead.
    constexpr std::int64_t kMaxSamples = std::int64_t{1} << 20;
    // Largest bounds first: their results make reads of smaller ones unnecessary.
    std::ranges::stable_sort(groups_, std::ranges::greater(), &Group::error);
    std::int64_t left = kMaxSamples;
    for (const Group& group : groups_) {
      if (group.error <= bound) return {};
      SampleBox all;
      for (const Cell& loose : group.cells) {
        if (loose.error > bound && !loose.cell_samples.samples.empty()) all = all.Around(loose.cell_samples.samples);
      }
      if (all.empty()) continue;
      if (all.columns() > left || all.rows() > left || all.columns() * all.rows() > left) {
        bound = group.error;
        return {};
      }
      left -= all.columns() * all.rows();
      const GridWindow window{all.west, all.north, all.columns(), all.rows()};
      const auto samples = grid_.ReadSamples(window, stop);
      if (!samples) return tl::unexpected(samples.error());
      for (const Cell& loose : group.cells) {
        if (loose.error <= bound) continue;
        const double error = single_.BoundBySamples(loose.cell, loose.cell_samples, window, *samples, 0, bound);
        bound = std::max(bound, std::min(loose.error, error));
      }
    }
    return {};
  }

 private:
  struct Cell {
    TileCell cell;
    CellErrorBound::CellSamples cell_samples;
    double error;
  };
  struct Group {
    std::vector<Cell> cells;
    double error = 0;
  };

  const RasterGrid& grid_;
  const CellErrorBound& single_;
  std::vector<Group> groups_;
};

}  // namespace

// The bound for one raster grid: by groups of cells, then by quarters of the groups that cannot be bounded as a whole,
// and so on down to single cells. Large boxes come first, because cells below the bound known by then need no work.
class GridErrorBound {
 public:
  GridErrorBound(SourceErrorBound& tile, const RasterGrid& grid, const GridReading& reading)
      : tile_(tile),
        nodes_{tile.lattice_, tile.window_, tile.heights_},
        grid_(grid),
        reading_(reading),
        statistics_(grid, reading),
        geoid_(nodes_, grid.undulations(), reading.undulations),
        smooth_(nodes_, grid, reading, statistics_, geoid_, tile.blends_),
        single_(nodes_, grid, reading, statistics_, geoid_),
        loose_(grid, single_) {}

  Result<void> Add(const std::stop_token& stop) {
    constexpr int kGroup = SourceErrorBound::kGroup;
    const int cells = nodes_.cells();
    bool may_rest_be_bounded = true;
    for (int south = 0; south < cells; south += kGroup) {
      const int north = std::min(south + kGroup, cells);
      if (AddRows({0, south, cells, north})) {
        // Most often on the sea, where the rest of the tile is like its first rows.
        if (north < cells && may_rest_be_bounded && AddRows({0, north, cells, cells})) break;
        may_rest_be_bounded = false;
        continue;
      }
      for (int west = 0; west < cells; west += kGroup) {
        AddGroup({west, south, std::min(west + kGroup, cells), std::min(south + kGroup, cells)});
      }
    }
    // Dividing adds smaller boxes to the end.
    for (std::size_t k = 0; k < uneven_.size(); ++k) Divide(uneven_[k].box, uneven_[k].may_blend);
    return loose_.Read(tile_.bound_, stop);
  }

 private:
  std::size_t CellIndex(int i, int j) const { return IndexAt(i, j, nodes_.cells()); }
  bool Touches(const CellBox& box) const {
    return grid_.reach().Touches(nodes_.West(box), nodes_.South(box), nodes_.Width(box), nodes_.Height(box));
  }
  void Raise(double error) { tile_.bound_ = std::max(tile_.bound_, error); }

  // If raster grids are blended, every contributing raster grid is bounded separately, because blended heights lie
  // between them. Filled heights count, too.
  bool MayBlend(const CellBox& box) const {
    if (!tile_.blends_) return false;
    const PixelBounds at = smooth_.BoundsOf(box);
    const double factor = reading_.factor;
    if (!(at.west <= at.east)) return true;
    if (reading_.includes_filled && CountInFull(at)) return false;
    return grid_.MayBlend({at.west * factor, at.north * factor, (at.east + 1) * factor, (at.south + 1) * factor},
                          reading_.factor);
  }

  // Checks all samples around a box. Weights are rounded to 2^-10.
  bool CountInFull(const PixelBounds& at) const {
    if (reading_.weights.empty()) return true;
    const GridWindow& window = reading_.window;
    const auto west = static_cast<std::int64_t>(std::floor(at.west)) - 1;
    const auto east = static_cast<std::int64_t>(std::floor(at.east)) + 2;
    const auto north = static_cast<std::int64_t>(std::floor(at.north)) - 1;
    const auto south = static_cast<std::int64_t>(std::floor(at.south)) + 2;
    if (west < window.column || east >= window.column + window.columns || north < window.row ||
        south >= window.row + window.rows) {
      return false;
    }
    for (std::int64_t row = north; row <= south; ++row) {
      const auto first = reading_.weights.begin() + (row - window.row) * window.columns + (west - window.column);
      if (std::any_of(first, first + (east - west + 1), [](float weight) { return weight < 1; })) return false;
    }
    return true;
  }

  // Whether the box may have filled heights that the reading does not contain.
  bool MayBeFilled(const CellBox& box) const {
    if (reading_.includes_filled) return false;
    const PixelBounds at = smooth_.BoundsOf(box);
    const double factor = reading_.factor;
    const auto has_voids = [&] {
      return grid_
          .Ranges({(at.west - 1) * factor, (at.north - 1) * factor, (at.east + 2) * factor, (at.south + 2) * factor})
          .has_voids;
    };
    return !(at.west <= at.east) || has_voids();
  }

  bool HasCell(const CellBox& box, std::uint8_t covered) const {
    for (int j = box.south; j < box.north; ++j) {
      const auto first = tile_.covered_.begin() + static_cast<std::ptrdiff_t>(CellIndex(box.west, j));
      const auto end = first + (box.east - box.west);
      if (std::find(first, end, covered) != end) return true;
    }
    return false;
  }
  bool IsPartlyCovered(const CellBox& box) const { return HasCell(box, 1); }
  bool IsCovered(const CellBox& box) const { return !HasCell(box, 0); }

  // Adds whole rows of cells at once if their bound is not above the known one. Then those of the groups are not
  // either: every part of the bound grows with the box, except that of a geoid. Where positions are not separable, the
  // bound of rows takes as long as those of their groups, and is seldom small enough.
  bool AddRows(const CellBox& box) {
    if (!reading_.cells.is_separable() || tile_.blends_ || geoid_.is_added() || IsCovered(box) || !Touches(box)) {
      return false;
    }
    Prepare(box);
    const double error = smooth_.BoundOver(box);
    if (!(error <= tile_.bound_)) return false;
    const auto first = tile_.covered_.begin() + static_cast<std::ptrdiff_t>(CellIndex(0, box.south));
    std::fill_n(first, Area(box.north - box.south, nodes_.cells()), std::uint8_t{1});
    return true;
  }

  void Prepare(const CellBox& box) {
    if (prepared_south_ == box.south && prepared_north_ == box.north) return;
    smooth_.PrepareRows(box.south, box.north);
    prepared_south_ = box.south;
    prepared_north_ = box.north;
  }

  void AddGroup(const CellBox& box) {
    if (IsCovered(box) || !Touches(box)) return;
    Prepare(box);
    AddBox(box, true);
  }

  // Bounds the box as a whole if possible; else it is divided later. `parent_may_blend`: whether the box that this is a
  // quarter of may have blended heights.
  void AddBox(const CellBox& box, bool parent_may_blend) {
    if (!Touches(box)) return;
    const bool may_blend = parent_may_blend && MayBlend(box), is_filled = may_blend && MayBeFilled(box);
    const bool is_partly_hidden = tile_.blends_ && IsPartlyCovered(box);
    const double error = is_filled || is_partly_hidden ? kUnknownError : smooth_.BoundOver(box);
    if (!std::isfinite(error)) {
      if (!tile_.blends_ && !tile_.counts_between_ && HasNoHeights(box) && single_.HasNoSamples(box)) return;
      uneven_.push_back({box, may_blend});
      return;
    }
    Raise(error);
    if (may_blend) return;
    for (int j = box.south; j < box.north; ++j) {
      const auto first = tile_.covered_.begin() + static_cast<std::ptrdiff_t>(CellIndex(box.west, j));
      std::fill_n(first, box.east - box.west, 1);
    }
  }

  // Whether no node of the box took its height from the raster grid.
  bool HasNoHeights(const CellBox& box) const {
    for (int j = box.south; j <= box.north; ++j) {
      const auto first = reading_.heights.begin() + static_cast<std::ptrdiff_t>(nodes_.NodeIndex(box.west, j));
      if (!std::all_of(first, first + (box.east - box.west + 1), [](float height) { return std::isnan(height); })) {
        return false;
      }
    }
    return true;
  }

  // By value: AddBox may move the boxes.
  void Divide(CellBox box, bool may_blend) {
    constexpr int kSmallest = 2;
    if (box.east - box.west <= kSmallest) {
      for (int j = box.south; j < box.north; ++j) {
        for (int i = box.west; i < box.east; ++i) {
          if (tile_.covered_[CellIndex(i, j)] == 0) AddCell(i, j, may_blend && MayBlend({i, j, i + 1, j + 1}));
        }
      }
      return;
    }
    const int middle_x = (box.west + box.east) / 2, middle_y = (box.south + box.north) / 2;
    for (const CellBox& quarter :
         {CellBox{box.west, box.south, middle_x, middle_y}, CellBox{middle_x, box.south, box.east, middle_y},
          CellBox{box.west, middle_y, middle_x, box.north}, CellBox{middle_x, middle_y, box.east, box.north}}) {
      if (!IsCovered(quarter)) AddBox(quarter, may_blend);
    }
  }

  void AddCell(int i, int j, bool may_blend) {
    const bool fills = may_blend && !reading_.includes_filled;
    const TileCell cell = nodes_.Cell(i, j);
    if (std::ranges::any_of(cell.nodes, [&](std::size_t node) { return std::isnan(reading_.heights[node]); })) {
      if (Touches(cell.box())) AddUneven(cell, may_blend, fills, kUnknownError);
      return;
    }
    bool has_voids = false;
    double error = single_.BoundByAverages(cell, has_voids);
    if (fills && (has_voids || MayBeFilled(cell.box()))) return AddUneven(cell, true, true, kUnknownError);
    if (!has_voids && !may_blend) tile_.covered_[CellIndex(i, j)] = 1;
    if (error <= tile_.bound_) return;
    const double smooth = has_voids ? kUnknownError : smooth_.BoundOver(cell.box());
    if (std::isfinite(smooth)) return Raise(std::min(smooth, error));
    AddUneven(cell, may_blend, fills, error);
  }

  // `known`: a bound known so far.
  void AddUneven(const TileCell& cell, bool may_blend, bool fills, double known) {
    if (known <= tile_.bound_) return;
    std::optional<CellErrorBound::CellSamples> cell_samples;
    const double error = std::min(known, single_.BoundBySurroundings(cell, may_blend || tile_.counts_between_, fills,
                                                                     tile_.bound_, cell_samples));
    if (error <= tile_.bound_) return;
    if (!cell_samples || !LooseCells::MayRead(reading_.factor)) return Raise(error);
    loose_.Add(cell, *cell_samples, error);
  }

  SourceErrorBound& tile_;
  const TileNodes nodes_;
  const RasterGrid& grid_;
  const GridReading& reading_;
  const GridStatistics statistics_;
  const GeoidErrorBound geoid_;
  SmoothErrorBound smooth_;
  const CellErrorBound single_;
  LooseCells loose_;
  int prepared_south_ = -1, prepared_north_ = -1;  // of smooth_
  struct UnevenBox {
    CellBox box;
    bool may_blend;
  };
  std::vector<UnevenBox> uneven_;  // not bounded as a whole
};

SourceErrorBound::SourceErrorBound(const geo::Lattice& lattice, const NodeWindow& window,
                                   std::span<const float> heights, bool blends, bool counts_between)
    : lattice_(lattice),
      window_(window),
      heights_(heights),
      blends_(blends),
      counts_between_(counts_between),
      covered_(Area(lattice.cells, lattice.cells)) {}

Result<void> SourceErrorBound::Add(const RasterGrid& grid, const GridReading& reading, const std::stop_token& stop) {
  return GridErrorBound(*this, grid, reading).Add(stop);
}

bool SourceErrorBound::is_covered() const { return std::memchr(covered_.data(), 0, covered_.size()) == nullptr; }

}  // namespace terrace::dem
