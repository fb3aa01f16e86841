// Detects that a configuration may have changed since it was loaded, without parsing it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "config/config.h"
#include "config/file/parse.h"

namespace terrace::config {

// Not thread-safe.
class ConfigWatch {
 public:
  // `file`: the configuration file; empty: none. `load`: makes the configuration from the file, flags and folders.
  // `now_ns`: nanoseconds since the epoch, on the clock of file times.
  ConfigWatch(std::filesystem::path file, std::function<ConfigResult()> load,
              std::function<std::int64_t()> now_ns = SystemTimeNs)
      : file_(std::move(file)), load_(std::move(load)), now_ns_(std::move(now_ns)) {}

  static std::int64_t SystemTimeNs();

  ConfigResult Load();

  // Returns false if nothing can have changed: the file has the device, inode, size and times that it had before the
  // last Load, it was not written to shortly before that, and folders and globs among the sources contain the same
  // files. Returns true after a failed Load.
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
  std::optional<Stamp> stamp_;            // nothing: not a regular file
  bool is_fresh_ = false;                 // the file was written to shortly before it was read
  std::vector<SourceConfig> expandable_;  // folders and globs
};

}  // namespace terrace::config
