// A folder of files with statistics and averages of rasters. A budget limits their total size.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

namespace terrace::dem {

// Thread-safe. Several processes may share a folder; each needs one object for it. A program passes the object to
// models as RasterCache::folder, and calls Trim after it has opened them.
//
// The folder is created when the first file is written. If that fails, models open nevertheless, and problem() has the
// reason. The path is resolved at each use.
//
// If the budget is short, files that no model of this object uses are removed, the least recently used first. Files in
// use may fill the whole budget. Other files are neither counted nor removed: those that terrace did not write, and the
// hashes of large files (FileContentOptions).
class CacheFolder {
 public:
  static constexpr std::uint64_t kUnbounded = ~std::uint64_t{0};

  explicit CacheFolder(std::string path, std::uint64_t max_bytes = kUnbounded);
  ~CacheFolder();
  CacheFolder(const CacheFolder&) = delete;
  CacheFolder& operator=(const CacheFolder&) = delete;

  const std::string& path() const;

  // Removes files until the budget is met. Logs a warning if files in use exceed it.
  void Trim();

  // Why a file in use could not be stored, or that a stored file is gone or cannot be read. Empty: nothing is known. A
  // damaged file is not reported here, but by ElevationModel::has_lost_cache.
  std::string problem() const;

  class Files;  // cache_files.h, for terrace's own code
  Files& files() { return *files_; }

 private:
  const std::unique_ptr<Files> files_;
};

}  // namespace terrace::dem
