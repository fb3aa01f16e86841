// Hashes of the bytes of masks, images and PROJ grids. Elevation rasters are hashed together with their statistics.
#pragma once

#include "engine/common/content_hash.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/gdal/stamped_files.h"

namespace terrace::dem {

// Hashes all files in order, but not their paths, inodes and times. Files with a GDAL path, which may be remote, are
// not read: StampedFiles::gdal_path_fingerprints is used instead. The hash of a file is cached as long as its stamp is
// unchanged: in memory, and for large files in `cache_dir` as well. kChanged: a file has changed since it was stamped.
// kUnavailable: it cannot be read. kCancelled: stopped.
Result<ContentHash> HashFiles(const StampedFiles& files, const FileContentOptions& options = {});

}  // namespace terrace::dem
