// Averages of a raster in its file of the cache folder.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "engine/common/open_file.h"
#include "engine/core/result.h"
#include "engine/statistics/kept_factors.h"
#include "engine/statistics/raster_chunk.h"

namespace terrace::dem {

// Averages of KeptFactors in a finished cache file. Thread-safe. Opens the file for each read, because a dataset may
// have thousands of them. The chunks that were read last are in memory, because adjacent tiles share them.
class CachedAverages {
 public:
  // For all rasters of the process.
  static constexpr std::size_t kMaxBytesInMemory = std::size_t{32} << 20;

  // `file`: the open cache file at `path`, which begins with `header`.
  CachedAverages(const OpenFile& file, std::string header, std::string path, RasterLayout layout,
                 std::vector<std::uint64_t> offsets);

  bool Has(int factor) const {
    return factor < kLargestMeasuredFactor && (factors_ & static_cast<unsigned>(factor)) != 0;
  }
  // The same values as ReadAverages. kInvalidArgument: the file is damaged. kNotFound: it was removed, or is no longer
  // accessible. kUnavailable: it cannot be opened now, because descriptors or memory have run out. Precondition:
  // Has(factor).
  Result<std::vector<float>> Read(int factor, const GridWindow& window) const;

  // Removes the file, unless another one has replaced it.
  void Discard() const;

  int min_factor() const { return static_cast<int>(factors_ & (~factors_ + 1)); }

  // Bytes read from the file so far.
  std::uint64_t bytes_read() const { return bytes_read_; }

 private:
  Result<OpenFile> Open() const;
  void TouchHourly(const OpenFile& file) const;
  Result<void> CopyChunk(const OpenFile& file, int factor, int index, const GridWindow& window, float* out) const;
  struct ChunkAverages;
  // Returns the averages of a chunk that is not void, `size` floats at `offset` of the chunk's averages in the file.
  Result<std::shared_ptr<const ChunkAverages>> ReadChunk(const OpenFile& file, int factor, int index,
                                                         std::uint64_t offset, std::size_t size) const;

  const std::uint64_t id_;  // of its chunks in memory
  FileIdentity identity_;
  std::string header_;  // a new file may get the inode of one that was removed
  std::string path_;
  RasterLayout layout_;
  unsigned factors_;
  ChunkGrid chunks_;
  std::vector<std::uint64_t> offsets_;  // by chunk, of its averages; 0: void
  mutable std::atomic<std::uint64_t> bytes_read_{0};
  mutable std::atomic<std::int64_t> touched_s_;  // by the steady clock
};

}  // namespace terrace::dem
