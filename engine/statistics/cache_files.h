// The files of a CacheFolder: their names, which of them are in use, and the bytes that they take.
//
// Before a file grows, files that no model of this process uses are removed until an eighth of the budget is free.
// Loading a file counts as use, and so do reads of averages, at most once an hour; the time of the last use is the
// file's modification time. Other files, such as the hashes of file_content.h, are neither counted nor removed: a file
// is recognized by its name and its first bytes.
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

#include "engine/common/file_stamp.h"
#include "engine/core/result.h"
#include "engine/statistics/cache_folder.h"

namespace terrace::dem {

class CacheFileUse;

// Thread-safe.
class CacheFolder::Files {
 public:
  // The extension of finished files, and the suffix of files that are being written.
  static constexpr std::string_view kEnding = ".statistics", kPartial = ".partial";
  static constexpr std::uint64_t kMagic = 0x31'53'54'41'54'53'52'54;  // "TRSTATS1", the first bytes of each file

  Files(std::string path, std::uint64_t max_bytes) : path_(std::move(path)), max_bytes_(max_bytes) {}

  const std::string& path() const { return path_; }

  // Reserves bytes by which a file is about to grow. kUnavailable: files in use occupy the budget.
  Result<void> Reserve(std::uint64_t bytes);
  // Releases bytes that were reserved.
  void Release(std::uint64_t bytes);
  void Trim();                  // as CacheFolder::Trim
  std::string problem() const;  // as CacheFolder::problem; without the file's path

 private:
  friend class CacheFileUse;
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
  std::multiset<std::string> in_use_;                    // names; mutex_ guards this and all members below
  std::map<const CacheFileUse*, std::string> problems_;  // reasons
  std::uint64_t bytes_ = 0, since_scan_ = 0;             // known size of all files; bytes reserved since the last scan
  std::optional<std::chrono::steady_clock::time_point> scanned_at_;
  std::multimap<std::int64_t, File> oldest_first_;  // files that were not in use at the last scan, by modification time
};

// Marks one raster's file as in use until the object is destroyed. The file need not exist.
class CacheFileUse {
 public:
  CacheFileUse(std::shared_ptr<CacheFolder> folder, const std::string& file);
  ~CacheFileUse();
  CacheFileUse(const CacheFileUse&) = delete;
  CacheFileUse& operator=(const CacheFileUse&) = delete;

  // Reports that the file can be neither stored nor read. `reason`: "cannot be written: No space left on device".
  void Fail(const std::string& reason) const;
  // Withdraws the report of Fail.
  void Succeed() const;

 private:
  const std::shared_ptr<CacheFolder> folder_;  // keeps files_ alive
  CacheFolder::Files& files_;
  const std::string name_;
};

}  // namespace terrace::dem
