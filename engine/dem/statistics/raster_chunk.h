// A raster part by part: what is learnt from one part of 1024 x 1024 samples, on its own.
//
// What a part says depends on the raster alone, never on which parts were looked at before: they can be kept, and a
// statistics that was interrupted goes on behind the last one (statistics_cache.h).
#pragma once

#include <gdal_priv.h>

#include <cstdint>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/common/range_table.h"
#include "engine/dem/raster/block_averages.h"
#include "engine/dem/raster/sample_grid.h"
#include "engine/dem/statistics/undeclared_nodata.h"

namespace terrace::dem {

struct Chunk {
  int col = 0, row = 0, cols = 0, rows = 0;  // pixels
};

constexpr int DivideUp(int a, int b) { return (a + b - 1) / b; }

// The parts of a raster, by rows from the north-west.
class ChunkGrid {
 public:
  static constexpr int kSide = 1024;

  ChunkGrid() = default;
  ChunkGrid(int width, int height)
      : width_(width), height_(height), columns_(DivideUp(width, kSide)), rows_(DivideUp(height, kSide)) {}

  int columns() const { return columns_; }
  int count() const { return columns_ * rows_; }
  Chunk At(int index) const;

 private:
  int width_ = 0, height_ = 0, columns_ = 0, rows_ = 0;
};

// Factors whose averages are compared with the samples themselves: 2, 4, .. kLargestDirect.
inline constexpr int kLargestDirect = 64;

// Voids first .. last of a row, counted from a part's first sample.
struct VoidRun {
  std::uint16_t row, first, last;

  friend bool operator==(const VoidRun&, const VoidRun&) = default;
};

struct ChunkStatistics {
  std::int64_t valid = 0;  // samples
  ZeroEdges zeros;
  BlockSum first_row, last_row;    // the part of the raster's outermost rows that lies here
  std::vector<BlockRange> ranges;  // of its RangeTable blocks, by rows
  std::vector<VoidRun> voids;      // among the columns in use, by rows; empty where all of it is void
  // By factor 2, 4, .. kLargestDirect, as far as the raster has them:
  std::vector<std::vector<float>> errors;    // of its AveragingErrors blocks, or its part of one
  std::vector<std::vector<float>> averages;  // its own, by rows; empty where an overview gives them
  std::vector<std::vector<BlockSum>> sums;   // of factors 128 .. 1024, as the averages

  bool is_void() const { return valid == 0; }
};

// A void part's statistics. It has no averages and no sums: theirs are voids.
ChunkStatistics VoidStatistics(const Chunk& chunk, const RasterLayout& layout);

// How many averages of that factor a part that is not void has; 0 where an overview gives them.
std::size_t AveragesIn(const Chunk& chunk, const RasterLayout& layout, int factor);

// kUnavailable: it cannot be read. kCancelled: stopped. `read` counts the parts whose samples were read: those that the
// file does not store are known to be void without.
Result<ChunkStatistics> ReadChunkStatistics(GDALDataset& dataset, const RasterLayout& layout, const Chunk& chunk,
                                            std::int64_t& read, const std::stop_token& stop = {});

}  // namespace terrace::dem
