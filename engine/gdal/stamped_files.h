// Files as they were when they were opened, to notice that one of them has changed.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "engine/common/file_stamp.h"
#include "engine/core/result.h"

namespace terrace::dem {

// Returns kChanged with the message that `path` is no longer the file that was opened.
Error ChangedError(const std::string& path);

// The files a raster is made of (the file itself, overviews and masks beside it, the parts of a mosaic) as they were
// when it was opened.
class StampedFiles {
 public:
  StampedFiles() = default;
  // Stamps regular files. GDAL paths (/vsi: remote files, archive members) are not watched; their fingerprint covers
  // path, size and ETag, or the modification time where there is no ETag. Without both it differs at each start. Other
  // paths are ignored.
  explicit StampedFiles(const std::vector<std::string>& paths);

  // Stamps files that have just been opened. `before` is the stamp of the first file before it was opened. kChanged:
  // the first file differs from `before`, so it may have been replaced during the opening.
  static Result<StampedFiles> OfOpened(const std::vector<std::string>& paths, const std::optional<FileStamp>& before);

  // Returns the first file that was changed or removed since; nullopt if there is none.
  std::optional<std::string> FirstChanged() const;

  // kChanged: FirstChanged finds a file. `path`: the raster's, for the message.
  Result<void> CheckUnchanged(const std::string& path) const;

  // Access to single watched files, i < size().
  std::size_t size() const { return paths_.size(); }
  bool HasChanged(std::size_t i) const { return StampOf(paths_[i]) != stamps_[i]; }
  const std::string& path(std::size_t i) const { return paths_[i]; }
  const FileStamp& stamp(std::size_t i) const { return stamps_[i]; }
  void Append(const StampedFiles& more);

  // Returns a hash of all stamps and GDAL paths.
  std::uint64_t fingerprint() const;
  // Fingerprints of the GDAL paths, in order.
  const std::vector<std::uint64_t>& gdal_path_fingerprints() const { return others_; }

 private:
  std::vector<std::string> paths_;
  std::vector<FileStamp> stamps_;
  std::vector<std::uint64_t> others_;  // fingerprints of GDAL paths, which are not watched
};

}  // namespace terrace::dem
