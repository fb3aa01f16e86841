// Averages of a raster in memory, for rasters whose averages are not in a cache folder.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "engine/common/averages_budget.h"
#include "engine/statistics/raster_chunk.h"
#include "engine/statistics/raster_statistics.h"

namespace terrace::dem {

// Averages by the factors of KeptFactors, beginning with the smallest factor that fits. Filled by one thread, then
// immutable and thread-safe.
class MemoryAverages {
 public:
  // Null: the raster needs none, or none fit. One raster takes at most an eighth of the remaining budget, so that each
  // of many gets at least coarse averages.
  static std::unique_ptr<MemoryAverages> Make(const RasterLayout& layout, std::shared_ptr<AveragesBudget> budget);
  ~MemoryAverages();
  MemoryAverages(const MemoryAverages&) = delete;
  MemoryAverages& operator=(const MemoryAverages&) = delete;

  void Add(const Chunk& chunk, const ChunkStatistics& chunk_statistics);

  bool Has(int factor) const;
  // The same values as ReadAverages. Precondition: Has(factor).
  std::vector<float> Read(int factor, const GridWindow& window) const;
  int min_factor() const { return levels_.front().factor; }
  std::size_t bytes() const { return bytes_; }

 private:
  struct Level {
    int factor = 0;
    AveragesGrid grid;
  };
  MemoryAverages(std::shared_ptr<AveragesBudget> budget, std::vector<Level> levels, std::size_t bytes);

  const std::shared_ptr<AveragesBudget> budget_;
  std::vector<Level> levels_;  // by factor
  const std::size_t bytes_;
};

}  // namespace terrace::dem
