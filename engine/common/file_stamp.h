// Identifies the state of a file by device, inode, size, times of modification and of change of status.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace terrace::dem {

struct FileStamp {
  std::uint64_t device = 0, inode = 0, size = 0, modified_ns = 0;
  // Time of the last status change (ctime), which a program cannot set back. Keys of caches of what was read from a
  // file contain it; fingerprint() of models, images and masks does not. Not compared by ==: a change of permissions
  // must not count as a change of an open file.
  std::uint64_t status_changed_ns = 0;

  friend bool operator==(const FileStamp& a, const FileStamp& b) {
    return a.device == b.device && a.inode == b.inode && a.size == b.size && a.modified_ns == b.modified_ns;
  }
};

// Returns the file's stamp; nullopt if `path` or `descriptor` is not a regular file.
std::optional<FileStamp> StampOf(const std::string& path);
std::optional<FileStamp> StampOf(int descriptor);

}  // namespace terrace::dem
