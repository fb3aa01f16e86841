// Whether a configuration may be another one than when it was loaded, found out without parsing it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "config/config.h"
#include "config/parse.h"

namespace terrace::config {

// Of one thread.
class ConfigWatch {
 public:
  // `file`: the configuration's; empty: there is none. `load` makes the configuration from it and from what else there
  // is. `now_ns`: nanoseconds since the epoch, as the times of files have them.
  ConfigWatch(std::filesystem::path file, std::function<ConfigResult()> load,
              std::function<std::int64_t()> now_ns = SystemTimeNs)
      : file_(std::move(file)), load_(std::move(load)), now_ns_(std::move(now_ns)) {}

  static std::int64_t SystemTimeNs();

  ConfigResult Load();

  // False: the file has the device, inode, size and times that it had before the last Load, had them for a while, and
  // folders and globs among the sources hold the files that they held. True as well after a Load that failed.
  bool MayHaveChanged() const;

 private:
  struct Stamp {
    std::uint64_t device = 0, inode = 0, size = 0;
    std::int64_t modified_ns = 0, status_changed_ns = 0;

    friend bool operator==(const Stamp&, const Stamp&) = default;
  };
  static std::optional<Stamp> StampOf(const std::filesystem::path& file);

  const std::filesystem::path file_;
  const std::function<ConfigResult()> load_;
  const std::function<std::int64_t()> now_ns_;
  bool is_loaded_ = false;
  std::optional<Stamp> stamp_;            // nothing: no regular file
  bool is_fresh_ = false;                 // the file was written to a moment before it was read
  std::vector<SourceConfig> expandable_;  // folders and globs
};

}  // namespace terrace::config
