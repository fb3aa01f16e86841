// Statistics of a raster, read once before it is served: ranges of heights, voids, means of the outermost rows, coarse
// averages, and the errors of averages. One pass over the raster, chunk by chunk.
#pragma once

#include <gdal_priv.h>

#include <array>
#include <cstdint>
#include <optional>
#include <stop_token>
#include <vector>

#include "engine/common/content_hash.h"
#include "engine/common/range_table.h"
#include "engine/core/result.h"
#include "engine/raster/raster_layout.h"
#include "engine/statistics/averaging_errors.h"
#include "engine/statistics/raster_chunk.h"
#include "engine/statistics/rim_voids.h"
#include "engine/statistics/undeclared_nodata.h"

namespace terrace::dem {

// All averages of a raster by one factor, row by row.
struct AveragesGrid {
  std::int64_t columns = 0, rows = 0;
  std::vector<float> heights;

  // The same result as ReadAverages: columns may lie around the Earth.
  std::vector<float> Read(const GridWindow& window) const;
};

// All averages of factors kLargestMeasuredFactor and above: about a 3000th of the raster's samples. Empty for a raster
// whose overviews have them (KeepsCoarse).
class CoarseAverages {
 public:
  using Grid = AveragesGrid;

  // Grids of voids with the sizes for a raster.
  static CoarseAverages ShapedFor(const RasterLayout& layout);

  bool Has(int factor) const;
  // The result of ReadAverages. Precondition: Has(factor).
  std::vector<float> Read(int factor, const GridWindow& window) const;

  std::vector<Grid> grids;  // of factor kLargestMeasuredFactor, twice that, ..
};

struct RasterStatistics {
  ContentHash content;            // of all heights, including those of overviews that are read
  RangeTable ranges;              // overviews that are read count too: their resampling may overshoot the samples
  float lowest = 0, highest = 0;  // of the samples; 0 if all are voids
  // An overview that is read has a height far outside the range of the raster's samples around it: it was made of
  // nodata values, or of other samples.
  bool has_stray_overviews = false;
  std::uint64_t valid = 0, voids = 0;
  RimVoids rim_voids;
  std::uint64_t enclosed_samples = 0;  // of voids that do not touch the rim; 0 if rim_voids.is_everything()
  ZeroEdges zeros;
  std::array<std::optional<double>, 2> edge_row_means;  // of the first and the last row's valid samples
  AveragingErrors errors;
  CoarseAverages coarse;

  // Memory of the tables.
  std::size_t bytes() const;
};

// Puts a raster's chunks together, in the order of ChunkGrid.
class StatisticsAssembler {
 public:
  explicit StatisticsAssembler(const RasterLayout& layout);
  StatisticsAssembler(const StatisticsAssembler&) = delete;
  StatisticsAssembler& operator=(const StatisticsAssembler&) = delete;

  void Add(const Chunk& chunk, const ChunkStatistics& chunk_statistics);

  // Reads overviews where the raster has some. kUnavailable: they cannot be read. kCancelled: stopped. Errors do not
  // name the file.
  Result<RasterStatistics> Finish(GDALDataset& dataset, const std::stop_token& stop);

 private:
  void AddSums(const Chunk& chunk, const ChunkStatistics& chunk_statistics);
  Result<void> FinishCoarse(GDALDataset& dataset, const std::stop_token& stop);
  Result<void> AddOverviews(GDALDataset& dataset, const std::stop_token& stop);

  const RasterLayout layout_;
  RasterStatistics statistics_;
  ContentHasher content_;
  RimVoidFinder voids_;
  BlockSum first_row_, last_row_;
  std::vector<BlockSum> largest_sums_;  // of factor ChunkGrid::kSide
};

}  // namespace terrace::dem
