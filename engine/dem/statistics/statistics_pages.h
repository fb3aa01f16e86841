// Memory budget for the statistics of a dataset's rasters. Statistics beyond it are read from the statistics cache on
// demand.
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>

#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// Two budgets of bytes: for tables that stay in memory with their raster, and for tables that are paged, evicted least
// recently used first. Thread-safe.
class StatisticsPages {
 public:
  using Tables = std::shared_ptr<const RasterStatistics>;

  StatisticsPages(std::size_t kept_bytes, std::size_t paged_bytes) : kept_left_(kept_bytes), most_paged_(paged_bytes) {}

  // Whether tables of this size fit the first budget. If so, they are charged to it.
  bool Admit(std::size_t bytes);

  // Null: not in memory.
  Tables Find(const void* raster);
  void Add(const void* raster, Tables tables);
  void Forget(const void* raster);

  std::size_t paged_bytes() const;

 private:
  struct Page {
    const void* raster;
    Tables tables;
    std::size_t bytes;
  };
  void Remove(std::list<Page>::iterator page);

  mutable std::mutex mutex_;
  std::size_t kept_left_;  // guarded by mutex_, as are these
  const std::size_t most_paged_;
  std::size_t paged_ = 0;
  std::list<Page> pages_;  // most recently used first
  std::unordered_map<const void*, std::list<Page>::iterator> by_raster_;
};

}  // namespace terrace::dem
