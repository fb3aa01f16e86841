// The tables of rasters' statistics, where there are more of them than memory is for: they are taken from their records
// when they are wanted.
#pragma once

#include <cstddef>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>

#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// Bytes of tables of one dataset: what is kept as long as its raster, and what comes and goes, used longest ago first.
// Thread-safe.
class StatisticsPages {
 public:
  using Tables = std::shared_ptr<const RasterStatistics>;

  StatisticsPages(std::size_t kept_bytes, std::size_t paged_bytes) : kept_left_(kept_bytes), most_paged_(paged_bytes) {}

  // Whether tables of this size are to be kept. They count from then on.
  bool Admit(std::size_t bytes);

  // Null: they are not here.
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
  std::list<Page> pages_;  // the one used last comes first
  std::unordered_map<const void*, std::list<Page>::iterator> by_raster_;
};

}  // namespace terrace::dem
