// A folder of statistics files (statistics_cache.h) within a budget of bytes.
//
// Several processes may share it. Before a file grows, those that were not used for longest are removed until there is
// room. A file counts as used when it is loaded, and once an hour while averages are read from it; its time of
// modification tells when. Files in use by this process stay. What terrace did not write is neither counted nor
// removed: a file is known by its name and by its first bytes.
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
#include "engine/dem/statistics/open_file.h"

namespace terrace::dem {

// Thread-safe.
class CacheFolder {
 public:
  static constexpr std::uint64_t kUnbounded = ~std::uint64_t{0};
  // Of the names of finished files, and what follows it while a file is made.
  static constexpr std::string_view kEnding = ".statistics", kPartial = ".partial";
  static constexpr std::uint64_t kMagic = 0x31'53'54'41'54'53'52'54;  // "TRSTATS1", the first bytes of each file

  explicit CacheFolder(std::string path, std::uint64_t max_bytes = kUnbounded);
  ~CacheFolder();
  CacheFolder(const CacheFolder&) = delete;
  CacheFolder& operator=(const CacheFolder&) = delete;

  const std::string& path() const { return path_; }
  std::uint64_t max_bytes() const { return max_bytes_; }

  // One raster's file, in use until this ends. The file need not exist.
  class Use {
   public:
    Use(std::shared_ptr<CacheFolder> folder, const std::string& file);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

    CacheFolder& folder() const { return *folder_; }
    // The file can be neither kept nor read. `reason`: "cannot be written: No space left on device".
    void Fail(const std::string& reason) const;
    void Succeed() const;

   private:
    const std::shared_ptr<CacheFolder> folder_;
    const std::string name_;
  };

  // Makes room for bytes that a file is about to grow by. kUnavailable: files in use take it.
  Result<void> Reserve(std::uint64_t bytes);
  // They were reserved, and are not there any more.
  void Release(std::uint64_t bytes);
  // Removes what is beyond the budget. A warning tells of files in use that are beyond it.
  void Trim();

  // Why a file in use is not kept; names no path. Empty: all are.
  std::string trouble() const;

 private:
  struct File {
    std::string name;  // in the folder
    FileIdentity identity;
    std::uint64_t bytes = 0;
    std::int64_t modified_ns = 0;
  };
  void Scan();
  void Evict(std::uint64_t bytes);
  bool IsInUse(const std::string& name) const;

  const std::string path_;
  const std::uint64_t max_bytes_;
  mutable std::mutex mutex_;
  std::multiset<std::string> in_use_;           // names; guarded by mutex_, as are these
  std::map<const Use*, std::string> troubles_;  // reasons
  std::uint64_t bytes_ = 0, since_scan_ = 0;    // of all files, as far as known; reserved since the last scan
  std::optional<std::chrono::steady_clock::time_point> scanned_at_;
  std::multimap<std::int64_t, File> oldest_first_;  // files that are not in use, of the last scan, by their time
};

}  // namespace terrace::dem
