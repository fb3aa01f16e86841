// One image for many threads, at full size and at the sizes of its overviews. Each ImageFile is used by one thread at a
// time. IdlePool keeps unused ones.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/common/idle_pool.h"
#include "engine/core/result.h"
#include "engine/gdal/stamped_files.h"
#include "engine/image/image_file.h"

namespace terrace::dem {

// Thread-safe.
class ImagePool {
 public:
  struct Size {
    int factor = 1;
    int overview = -1;            // GDAL's number of it; -1: the full image
    double across = 1, down = 1;  // pixels of the full image in one of this: the factor, or a little less
    IdlePool<ImageFile> idle = {};
  };
  struct Borrowed {
    const Size* size;
    IdlePool<ImageFile>::Handle image;
  };

  ImagePool(ImageFile image, StampedFiles files);

  // Borrows the smallest overview whose factor divides `factor`, a power of two; else the full image. kChanged: a file
  // of the image was removed or replaced. kUnavailable: it cannot be opened.
  Result<Borrowed> Borrow(int factor);

  // The largest factor that ImageBins can average to from the available sizes.
  int LargestFactor() const;

  // As HandlePool::CheckUnchanged.
  Result<void> CheckUnchanged();
  const StampedFiles& files() const { return files_; }

 private:
  std::string path_;
  StampedFiles files_;
  std::vector<std::unique_ptr<Size>> sizes_;  // by factor, ascending
};

}  // namespace terrace::dem
