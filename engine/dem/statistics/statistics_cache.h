// A raster's statistics in a file of the cache folder, so that they are read once (docs/formats/statistics-cache.md).
//
// A partial file is a list of chunks; an interrupted pass resumes after the last whole chunk. A finished file gets its
// final name. Everything has checksums. A file that does not match is reported in the log and made again.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/statistics/raster_statistics.h"

namespace terrace::dem {

// Owns a file descriptor.
class OpenFile {
 public:
  explicit OpenFile(int descriptor = -1) : descriptor_(descriptor) {}
  OpenFile(OpenFile&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  OpenFile& operator=(OpenFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~OpenFile();
  int get() const { return descriptor_; }
  bool is_open() const { return descriptor_ >= 0; }

 private:
  int descriptor_;
};

// Identifies a file as long as it exists, whatever its content.
struct FileIdentity {
  std::uint64_t device = 0, inode = 0;

  friend bool operator==(const FileIdentity&, const FileIdentity&) = default;
};

// Rasters with more samples than this and without overviews get averages in the cache. So no tile reads more samples.
inline constexpr std::int64_t kMaxSamplesWithoutAverages = std::int64_t{4096} * 4096;
bool NeedsAverages(const RasterLayout& layout);

// The smallest factor of averages in a cache file. kLargestDirect: none, because the statistics have the averages from
// that factor on. Rasters that need averages keep those by 2. Others of 1024 x 1024 samples and more without overviews
// keep those by 4, so that a tile reads at most about four samples per node. They take a third of a byte per sample;
// the averages by 2 would take four times as much and save a tenth of the tiles that read them (docs/performance.md).
int LeastKeptFactor(const RasterLayout& layout);

// The layout with the rules for detected nodata, and without overviews if there is any.
RasterLayout WithDetectedNodata(RasterLayout layout, const DetectedNodata& detected);

// The raster and rules that a cache file belongs to.
struct StatisticsShape {
  RasterLayout layout;      // without the rules for detected nodata
  std::uint64_t key = 0;    // hash of the raster's files and of all options that the statistics depend on
  DetectedNodata detected;  // stored in the file

  RasterLayout EffectiveLayout() const { return WithDetectedNodata(layout, detected); }
  int least_kept_factor() const { return LeastKeptFactor(EffectiveLayout()); }
};

// Averages of factors LeastKeptFactor .. kLargestDirect / 2 in a finished cache file. Thread-safe. Opens the file for
// each read, because a dataset may have thousands of them.
class CachedAverages {
 public:
  // `file`: the open cache file at `path`.
  CachedAverages(const OpenFile& file, std::string path, RasterLayout layout, std::vector<std::uint64_t> offsets);

  bool Has(int factor) const { return factor >= least_ && factor < kLargestDirect; }
  // The same values as ReadGrid. kInvalidArgument: the file is damaged or gone. kUnavailable: it cannot be opened now.
  // Precondition: Has(factor).
  Result<std::vector<float>> Read(int factor, const GridWindow& window) const;

  // Removes the file, unless another one has replaced it.
  void Discard() const;

  // By all reads so far.
  std::uint64_t bytes_read() const { return bytes_read_; }

 private:
  Result<OpenFile> Open() const;
  Result<void> CopyChunk(const OpenFile& file, int factor, int index, const GridWindow& window, float* out) const;

  FileIdentity identity_;
  std::string path_;
  RasterLayout layout_;
  int least_;  // factor
  ChunkGrid chunks_;
  std::vector<std::uint64_t> offsets_;  // by chunk, of its averages; 0: void
  mutable std::atomic<std::uint64_t> bytes_read_{0};
};

struct CachedStatistics {
  DetectedNodata detected;
  RasterStatistics statistics;
  std::shared_ptr<const CachedAverages> averages;  // null where they are not kept
};

// Nothing if there is no file, or one of another raster or other rules. Reports a damaged file in the log. Ignores
// `shape.detected`; the file has its own.
std::optional<CachedStatistics> LoadStatistics(const std::string& path, const StatisticsShape& shape);

// Writes a cache file, as `path`.partial until it is finished. Locked: one process at a time.
class StatisticsCacheWriter {
 public:
  // Waits while another process writes the file; returns nothing if that one has finished it. kUnavailable: the folder
  // is not writable. kCancelled: stopped.
  static Result<std::optional<StatisticsCacheWriter>> Open(const std::string& path, const StatisticsShape& shape,
                                                           const std::stop_token& stop);

  // Includes the detected nodata of an interrupted run.
  const StatisticsShape& shape() const { return shape_; }

  // Calls `keep` for every chunk of an interrupted run, in order. Call it once, before the first Add.
  Result<void> Resume(const std::function<void(const ChunkStatistics&)>& keep);

  // Discards all chunks, which were made without this detected nodata.
  Result<void> Restart(const DetectedNodata& detected);

  // Appends the next chunk. kUnavailable: it cannot be written; the file is removed, and later calls write nothing.
  Result<void> Add(const ChunkStatistics& chunk_statistics);

  // Renames the file to its final name, under which LoadStatistics finds it.
  Result<void> Finish(const RasterStatistics& statistics);

 private:
  StatisticsCacheWriter(OpenFile file, std::string path, const StatisticsShape& shape);
  Result<void> Begin();
  void KeepWholeChunks(const std::function<void(const ChunkStatistics&)>& keep);
  Result<void> Cut();
  Result<void> Write(std::string_view bytes);

  OpenFile file_;
  std::string path_;
  StatisticsShape shape_;
  RasterLayout layout_;  // the effective one
  ChunkGrid chunks_;
  std::uint64_t end_ = 0;
  std::vector<std::uint64_t> offsets_;
};

}  // namespace terrace::dem
