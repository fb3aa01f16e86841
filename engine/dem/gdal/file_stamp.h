// What tells one state of a file from another: device, inode, size, times of modification and of change of status.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

struct FileStamp {
  std::uint64_t device = 0, inode = 0, size = 0, modified_ns = 0;
  // When any of it changed last, which nobody can set back. It tells apart what is kept for the next start. Files in
  // use are not compared by it: a change of their permissions would be one.
  std::uint64_t status_changed_ns = 0;

  friend bool operator==(const FileStamp& a, const FileStamp& b) {
    return a.device == b.device && a.inode == b.inode && a.size == b.size && a.modified_ns == b.modified_ns;
  }
};

// Nothing when there is no regular file of that name.
std::optional<FileStamp> StampOf(const std::string& path);

// Of `path`, for people: it is not the file that was opened.
Error ChangedError(const std::string& path);

// The files a raster is made of (the file itself, overviews and masks beside it, the parts of a mosaic) as they were
// when it was opened.
class StampedFiles {
 public:
  StampedFiles() = default;
  // What is no regular file cannot be watched. Of a remote one and of a member of an archive the fingerprint tells
  // size, time and what its server calls its version; where none of these says more than a name, it is another one at
  // each start.
  explicit StampedFiles(const std::vector<std::string>& paths);

  // For files that have just been opened. kChanged: the first of them is not what it was before that (`before`), so
  // that nobody knows which of both was opened.
  static Result<StampedFiles> OfOpened(const std::vector<std::string>& paths, const std::optional<FileStamp>& before);

  // The first file that has changed or gone since; nothing when all are as they were.
  std::optional<std::string> FirstChanged() const;

  // kChanged: FirstChanged finds one. `path`: of the raster, for the message.
  Result<void> CheckUnchanged(const std::string& path) const;

  // File by file, for those who look at many of them.
  std::size_t size() const { return paths_.size(); }
  bool HasChanged(std::size_t i) const { return StampOf(paths_[i]) != stamps_[i]; }
  const std::string& path(std::size_t i) const { return paths_[i]; }
  void Append(const StampedFiles& more);

  // A hash of what all of them were.
  std::uint64_t fingerprint() const;

 private:
  std::vector<std::string> paths_;
  std::vector<FileStamp> stamps_;
  std::vector<std::uint64_t> others_;  // fingerprints of what cannot be watched
};

}  // namespace terrace::dem
