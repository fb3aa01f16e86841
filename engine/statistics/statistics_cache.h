// A raster's statistics in a file of the cache folder, so that they are read once (docs/formats/statistics-cache.md).
//
// A partial file is a list of chunks; an interrupted pass resumes after the last whole chunk. A finished file gets its
// final name. Everything has checksums. A file that does not match is reported in the log and made again.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "engine/common/open_file.h"
#include "engine/core/result.h"
#include "engine/statistics/cache_files.h"
#include "engine/statistics/cached_averages.h"
#include "engine/statistics/raster_statistics.h"

namespace terrace::dem {

// The layout with the rules for detected nodata. If any nodata was detected, overviews are left out.
RasterLayout WithDetectedNodata(RasterLayout layout, const DetectedNodata& detected);

// Identifies a cache file: the raster and the rules that it belongs to.
struct StatisticsKey {
  RasterLayout layout;      // without the rules for detected nodata
  std::uint64_t hash = 0;   // of the raster's files and of all options that the statistics depend on
  DetectedNodata detected;  // stored in the file

  RasterLayout EffectiveLayout() const { return WithDetectedNodata(layout, detected); }
  unsigned kept_factors() const { return KeptFactors(EffectiveLayout()); }
};

struct CachedStatistics {
  DetectedNodata detected;
  RasterStatistics statistics;
  std::shared_ptr<const CachedAverages> averages;  // null where they are not kept
};

// Nothing if there is no file, or one of another raster or other rules. Reports a damaged file in the log. Ignores
// `key.detected`; the file has its own.
std::optional<CachedStatistics> LoadStatistics(const std::string& path, const StatisticsKey& key);

// Writes a cache file, as `path`.partial until it is finished. Locked: one process at a time.
class StatisticsCacheWriter {
 public:
  // Waits while another process writes the file; returns nothing if one has finished it meanwhile. kUnavailable: the
  // folder is not writable, or files in use take its budget. kCancelled: stopped.
  static Result<std::optional<StatisticsCacheWriter>> Open(std::shared_ptr<CacheFolder> folder, const std::string& path,
                                                           const StatisticsKey& key, const std::stop_token& stop);

  // Includes the detected nodata of an interrupted run.
  const StatisticsKey& key() const { return key_; }

  // Calls `keep` for every chunk of an interrupted run, in order. Call it before the first Add, and again after
  // Restart.
  Result<void> Resume(const std::function<void(const ChunkStatistics&)>& keep);

  // Discards all chunks, which were made without this detected nodata.
  Result<void> Restart(const DetectedNodata& detected);

  // Appends the next chunk. kUnavailable: it cannot be written, and the file is removed. Do not use this
  // object after that.
  Result<void> Add(const ChunkStatistics& chunk_statistics);

  // Renames the file to its final name, under which LoadStatistics finds it.
  Result<void> Finish(const RasterStatistics& statistics);

 private:
  StatisticsCacheWriter(std::shared_ptr<CacheFolder> folder, OpenFile file, std::string path, const StatisticsKey& key);
  Result<void> Begin();
  void KeepWholeChunks(const std::function<void(const ChunkStatistics&)>& keep);
  Result<void> Cut();
  Result<void> Write(std::string_view bytes);
  void Remove();

  std::shared_ptr<CacheFolder> folder_;
  OpenFile file_;
  std::string path_;
  StatisticsKey key_;
  RasterLayout layout_;  // the effective one
  ChunkGrid chunks_;
  std::uint64_t end_ = 0;
  std::uint64_t reserved_ = 0;  // bytes
  std::vector<std::uint64_t> offsets_;
};

}  // namespace terrace::dem
