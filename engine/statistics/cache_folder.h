// A folder of files with statistics and averages of rasters. A budget limits their total size.
//
// The path is resolved at each use. A program passes the folder to models as RasterCache::folder, and calls Trim after
// it has opened them. The folder is created when the first file is written. If that fails, models open nevertheless,
// and problem() has the reason. Programs use the constructor, path(), Trim() and problem(); all other functions are for
// terrace's own code.
//
// Several processes may share it; each needs one object for it. Before a file grows, files that no model of this object
// uses are removed, the least recently used first, until an eighth of the budget is free. Files in use may fill the
// whole budget. Loading a file counts as use, and so do reads of averages, at most once an hour; the time of the last
// use is the file's modification time. Other files, such as the hashes of file_content.h, are neither counted nor
// removed: a file is recognized by its name and its first bytes.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "engine/gdal/file_stamp.h"

namespace terrace::dem {

// Thread-safe.
class CacheFolder {
 public:
  static constexpr std::uint64_t kUnbounded = ~std::uint64_t{0};
  // The extension of finished files, and the suffix of files that are being written.
  static constexpr std::string_view kEnding = ".statistics", kPartial = ".partial";
  static constexpr std::uint64_t kMagic = 0x31'53'54'41'54'53'52'54;  // "TRSTATS1", the first bytes of each file

  explicit CacheFolder(std::string path, std::uint64_t max_bytes = kUnbounded);
  ~CacheFolder();
  CacheFolder(const CacheFolder&) = delete;
  CacheFolder& operator=(const CacheFolder&) = delete;

  const std::string& path() const { return path_; }

  // Marks one raster's file as in use until the object is destroyed. The file need not exist.
  class Use {
   public:
    Use(std::shared_ptr<CacheFolder> folder, const std::string& file);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

    // Reports that the file can be neither stored nor read. `reason`: "cannot be written: No space left on device".
    void Fail(const std::string& reason) const;
    // Withdraws the report of Fail.
    void Succeed() const;

   private:
    const std::shared_ptr<CacheFolder> folder_;
    const std::string name_;
  };

  // Reserves bytes by which a file is about to grow. kUnavailable: files in use occupy the budget.
  Result<void> Reserve(std::uint64_t bytes);
  // Releases bytes that were reserved.
  void Release(std::uint64_t bytes);
  // Removes files until the budget is met. Logs a warning if files in use exceed it.
  void Trim();

  // Why a file in use could not be stored, or that a stored one is gone or cannot be read; without its path. Empty:
  // nothing is known. A damaged file is discarded without a report here. ElevationModel::has_lost_cache is true for
  // damaged files and for files that are gone.
  std::string problem() const;

 private:
  struct File {
    std::string name;  // in the folder
    FileStamp stamp;
  };
  void Scan();
  void Evict(std::uint64_t bytes);
  bool IsInUse(const std::string& name) const;

  const std::string path_;
  const std::uint64_t max_bytes_;
  mutable std::mutex mutex_;
  std::multiset<std::string> in_use_;           // names; mutex_ guards this and all members below
  std::map<const Use*, std::string> problems_;  // reasons
  std::uint64_t bytes_ = 0, since_scan_ = 0;    // known size of all files; bytes reserved since the last scan
  std::optional<std::chrono::steady_clock::time_point> scanned_at_;
  std::multimap<std::int64_t, File> oldest_first_;  // files that were not in use at the last scan, by modification time
};

}  // namespace terrace::dem
