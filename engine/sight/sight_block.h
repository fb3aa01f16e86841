// A block of samples, with the largest height of every part of it. Heights are ellipsoidal if
// SightBlocks::includes_undulations(), else in the source's datum.
#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <unordered_map>
#include <vector>

#include "engine/core/result.h"
#include "engine/mosaic/raster_grid.h"

namespace terrace::dem {

// The largest height of a range of cells, and whether it has voids.
struct CellsBound {
  float max = -std::numeric_limits<float>::infinity();  // -inf: nothing but voids
  bool has_voids = false;

  void Add(const CellsBound& other) {
    max = std::max(max, other.max);
    has_voids |= other.has_voids;
  }
};

// Immutable.
class SightBlock {
 public:
  // `undulations`: metres to add to the samples, one for each sample, NaN where not known; empty: none.
  SightBlock(const PointBlock& source, const std::vector<float>& undulations);

  const GridWindow& window() const { return window_; }
  const std::vector<float>& heights() const { return heights_; }  // metres; NaN: void
  // The samples with narrow voids filled and holes as NaN. Use it only to test for NaN: the values may lack the
  // undulations that heights() includes.
  const std::vector<float>& bridged() const { return bridged_.empty() ? heights_ : bridged_; }

  // A bound over the cells between two cells of the block, inclusive; possibly over more cells.
  CellsBound Over(std::int64_t west, std::int64_t north, std::int64_t east, std::int64_t south) const;
  // By sample, as heights(): the largest height of the 3 x 3 samples from it to the south-east, which are the corners
  // of 2 x 2 cells; voids do not count.
  const std::vector<float>& largest() const { return largest_; }

  // The largest heights of overlapping squares of cells. Square (i, j) covers 2 * side x 2 * side cells from cell
  // (i * side, j * side) on. A box of at most side x side cells lies in the square (column / side, row / side) of its
  // first cell.
  struct Squares {
    int shift = 0;  // side = 1 << shift
    std::int64_t columns = 0;
    std::vector<float> largest;

    float At(std::int64_t column, std::int64_t row) const {
      return largest[static_cast<std::size_t>((row >> shift) * columns + (column >> shift))];
    }
  };
  // With sides of 4 and 8 cells.
  const Squares& squares_of_4() const { return squares_of_4_; }
  const Squares& squares_of_8() const { return squares_of_8_; }

 private:
  struct Level {
    std::int64_t columns = 0, rows = 0;
    std::vector<CellsBound> cells;
  };

  GridWindow window_;
  std::vector<float> heights_, bridged_, largest_;  // bridged_: empty if its voids are those of heights_
  std::vector<Level> levels_;                       // cells of 2, 4, 8 .. cells a side
  Squares squares_of_4_, squares_of_8_;

  Squares SquaresOf(int shift) const;
};

// The number of blocks that are kept. One of 256 x 256 samples takes about 1 MB.
inline constexpr std::size_t kMaxSightBlocks = 256;

// The blocks of a raster grid that some rays cross. For one thread.
class SightBlocks {
 public:
  explicit SightBlocks(const RasterGrid& grid);

  // The block with a cell, valid until Trim. The column of a cell is 0 .. columns() - 1. Errors: those of
  // RasterGrid::FindPointBlock.
  Result<const SightBlock*> At(std::int64_t column, std::int64_t row, const std::stop_token& stop);
  // Drops all blocks if there are more than kMaxSightBlocks. Parts of a ray are looked at in order, so few are read
  // again.
  void Trim();
  std::size_t size() const { return blocks_.size(); }

  // Whether undulations are in the blocks: between samples at most 240 m apart they are as good as linear, up to 3 mm
  // at 1" where a line of the geoid's grid lies between two samples. Else Undulation has to be added at each position.
  bool includes_undulations() const { return geoid_ == nullptr || is_fine_; }
  // Metres. Precondition: !includes_undulations().
  double Undulation(Position degrees) const { return reader_->At(degrees); }
  // At least the largest undulation on Earth.
  static constexpr double kMaxUndulation = 120;

 private:
  Result<std::vector<float>> UndulationsOf(const GridWindow& window) const;

  const RasterGrid& grid_;
  std::shared_ptr<const Geoid> geoid_;  // null: heights are ellipsoidal
  std::unique_ptr<Geoid::Reader> reader_;
  bool is_fine_ = false;
  std::unordered_map<std::int64_t, std::unique_ptr<const SightBlock>> blocks_;
  std::int64_t last_ = -1;
  const SightBlock* last_block_ = nullptr;
};

}  // namespace terrace::dem
