// What tells one state of a file from another: device, inode, size and modification time.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace terrace::dem {

struct FileStamp {
  std::uint64_t device = 0, inode = 0, size = 0, modified_ns = 0;

  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};

// Nothing when there is no regular file of that name.
std::optional<FileStamp> StampOf(const std::string& path);

// The files a raster is made of (the file itself, overviews and masks beside it, the parts of a mosaic) as they were
// when it was opened. Immutable.
class StampedFiles {
 public:
  StampedFiles() = default;
  // Names that are no regular files (members of an archive) are left out: their archive is stamped.
  explicit StampedFiles(const std::vector<std::string>& paths);

  // The first file that has changed or gone since; nothing when all are as they were.
  std::optional<std::string> FirstChanged() const;

  const std::vector<FileStamp>& stamps() const { return stamps_; }

  // A hash of the stamps.
  std::uint64_t fingerprint() const;

 private:
  std::vector<std::string> paths_;
  std::vector<FileStamp> stamps_;
};

}  // namespace terrace::dem
