// A raster's statistics in a file of the cache folder, so that it is made once: docs/formats/statistics-cache.md.
//
// While it is made the file is a list of chunks, and what was interrupted goes on behind the last whole one. Finished,
// the file gets its real name. Everything is checksummed: what does not fit is reported, thrown away and made anew.
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

// A file descriptor that is closed.
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

// What tells a file from others while it is there, whatever is written to it.
struct FileIdentity {
  std::uint64_t device = 0, inode = 0;

  friend bool operator==(const FileIdentity&, const FileIdentity&) = default;
};

// Rasters with more samples than this and no overviews get averages in the cache folder: the first shallow tile of any
// other reads at most as many.
inline constexpr std::int64_t kMaxSamplesWithoutAverages = std::int64_t{4096} * 4096;
bool NeedsAverages(const RasterLayout& layout);

// The least factor of averages in a record; kLargestDirect: none are, as the statistics has those from there on.
// Rasters of a mosaic mostly begin at multiples of 8 or 16 pixels of each other, so that a shallow tile reads averages
// by so many of each of hundreds of rasters: those of 1024 x 1024 samples and more keep these, a 50th of what they
// have.
int LeastKeptFactor(const RasterLayout& layout);

// How a raster is read once its undeclared voids are known.
RasterLayout WithDetectedNodata(RasterLayout layout, const DetectedNodata& detected);

// What a record is of.
struct StatisticsShape {
  RasterLayout layout;      // its samples' rules without undeclared voids
  std::uint64_t key = 0;    // of everything the statistics depend on and the raster or its owner states
  DetectedNodata detected;  // undeclared voids, which the record itself knows

  RasterLayout EffectiveLayout() const { return WithDetectedNodata(layout, detected); }
  int least_kept_factor() const { return LeastKeptFactor(EffectiveLayout()); }
};

// Averages of factors from LeastKeptFactor up to kLargestDirect / 2 in a finished record. Thread-safe. The file is open
// only while it is read: a dataset may have thousands of them.
class CachedAverages {
 public:
  // `file`: the record, which `path` names.
  CachedAverages(const OpenFile& file, std::string path, RasterLayout layout, std::vector<std::uint64_t> offsets);

  bool Has(int factor) const { return factor >= least_ && factor < kLargestDirect; }
  // What ReadGrid gives. kInvalidArgument: the record is damaged, or gone. kUnavailable: it cannot be opened now.
  // Precondition: Has(factor).
  Result<std::vector<float>> Read(int factor, const GridWindow& window) const;

  // Removes the record's name, if it still has it: it is of no use any more.
  void Discard() const;

  // So far, by all readers.
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

// Nothing where there is no such file, or one of other samples; a damaged one is reported in the log first. Whatever
// the shape's detected are, the record's own count.
std::optional<CachedStatistics> LoadStatistics(const std::string& path, const StatisticsShape& shape);

// A record that is being made, under `path`.partial. One process at a time has it.
class StatisticsCacheWriter {
 public:
  // Waits while somebody else makes the record; nothing when that one has finished it. kUnavailable: the folder cannot
  // be written to. kCancelled: stopped.
  static Result<std::optional<StatisticsCacheWriter>> Open(const std::string& path, const StatisticsShape& shape,
                                                           const std::stop_token& stop);

  // With the detected of an interrupted run.
  const StatisticsShape& shape() const { return shape_; }

  // Calls `keep` for every chunk that an interrupted run left, from the first on. Once, before the first Add.
  Result<void> Resume(const std::function<void(const ChunkStatistics&)>& keep);

  // Throws all chunks away: they were made without these detected.
  Result<void> Restart(const DetectedNodata& detected);

  // The next of_chunk. kUnavailable: it cannot be written; the file is removed then, and nothing more is written.
  Result<void> Add(const ChunkStatistics& of_chunk);

  // Gives the file its name. From then on LoadStatistics finds it.
  Result<void> Finish(const RasterStatistics& statistics);

 private:
  StatisticsCacheWriter(OpenFile file, std::string path, const StatisticsShape& shape);
  Result<void> Begin();
  void KeepWholeParts(const std::function<void(const ChunkStatistics&)>& keep);
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
