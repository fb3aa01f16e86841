// Hashes of the bytes of files that are not read through for statistics: masks, images, grids of PROJ.
#pragma once

#include <stop_token>
#include <string>

#include "engine/core/result.h"
#include "engine/dem/common/content_hash.h"
#include "engine/dem/gdal/file_stamp.h"

namespace terrace::dem {

struct FileContentOptions {
  std::string cache_dir = {};  // keeps the hashes of large files; empty: none
  std::stop_token stop = {};
};

// Of all files in order. The path, the inode and the times of a file make no difference. Files with a GDAL path, which
// may be remote, are not read: they count by StampedFiles::other_fingerprints. The hash of a file is kept for as long
// as its stamp is the same: in memory, that of a large file in `cache_dir` as well.
// kChanged: a file is not the one that was stamped. kUnavailable: it cannot be read. kCancelled: stopped.
Result<ContentHash> HashFiles(const StampedFiles& files, const FileContentOptions& options = {});

}  // namespace terrace::dem
