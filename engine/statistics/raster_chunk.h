// Statistics of one chunk of a raster, 1024 x 1024 samples.
//
// They depend on the raster alone, not on the chunks read before. So they can be cached, and an interrupted pass
// resumes after the last cached chunk (statistics_cache.h).
#pragma once

#include <gdal_priv.h>

#include <cstdint>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/common/content_hash.h"
#include "engine/common/range_table.h"
#include "engine/core/result.h"
#include "engine/raster/block_averages.h"
#include "engine/raster/raster_layout.h"
#include "engine/statistics/undeclared_nodata.h"

namespace terrace::dem {

struct Chunk {
  int col = 0, row = 0, cols = 0, rows = 0;  // pixels
};

constexpr int DivideUp(int a, int b) { return (a + b - 1) / b; }

// The chunks of a raster, row by row from the north-west.
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

// Averages of factors 2, 4, .. kLargestMeasuredFactor are compared with the samples directly.
inline constexpr int kLargestMeasuredFactor = 64;

// Voids first .. last of a row, relative to the chunk's first sample.
struct VoidRun {
  std::uint16_t row, first, last;

  friend bool operator==(const VoidRun&, const VoidRun&) = default;
};

struct ChunkStatistics {
  ContentHash content;     // of the heights, row by row; zero of a void chunk
  std::int64_t valid = 0;  // samples
  ZeroEdges zeros;
  BlockSum first_row, last_row;    // of the raster's first and last row within the chunk
  std::vector<BlockRange> ranges;  // by RangeTable block, row by row
  std::vector<VoidRun> voids;      // in the columns in use, row by row; empty if the whole chunk is void
  // One entry per factor 2, 4, .. kLargestMeasuredFactor, up to the raster's largest factor. Errors are in metres, one
  // per AveragingErrors block; a block of factor 64 is larger than a chunk, so its error is of the part in this chunk.
  std::vector<std::vector<float>> errors;
  std::vector<std::vector<float>> averages;  // row by row; empty if an overview has them and they are not stored
  std::vector<std::vector<BlockSum>> sums;   // one entry per factor 128 .. 1024; row by row

  bool is_void() const { return valid == 0; }
  // For factors of KeptFactors: for all of them or none. A void chunk has averages if an overview has heights there.
  bool has_averages(unsigned factors) const;
};

// Why reading all chunks decodes the file's blocks many times, with the remedy; empty: it does not. Chunks side by side
// share blocks that are wider, and those of a row of chunks have to fit into GDAL's cache.
std::string DescribeWideBlocks(GDALDataset& dataset);

// Statistics of a void chunk, without averages and sums.
ChunkStatistics VoidStatistics(const Chunk& chunk, const RasterLayout& layout);

// Number of averages of a factor in a chunk that is not void; 0 if an overview has them.
std::size_t AveragesIn(const Chunk& chunk, const RasterLayout& layout, int factor);

// Increments `chunks_read` if samples were read; chunks that a sparse file does not store are void without reading.
// `dataset_mutex`: locked while the samples are read, so that several threads may share the dataset and `chunks_read`;
// null: one thread uses them. kUnavailable: the raster cannot be read. kCancelled: stopped.
Result<ChunkStatistics> ReadChunkStatistics(GDALDataset& dataset, const RasterLayout& layout, const Chunk& chunk,
                                            std::int64_t& chunks_read, const std::stop_token& stop = {},
                                            std::mutex* dataset_mutex = nullptr);

// Whether statistics need the dataset only for their samples. Otherwise threads must not share it: overviews, and the
// averages beyond the antimeridian, are read in between.
bool CanShareDataset(const RasterLayout& layout);

}  // namespace terrace::dem
