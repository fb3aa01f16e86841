// One image for many threads, at full size and by its overviews: each ImageFile is used by one thread at a time. What
// is not in use is kept as IdlePool says.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/common/idle_pool.h"
#include "engine/dem/gdal/file_stamp.h"
#include "engine/dem/image/image_file.h"

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

  // The smallest of the overviews whose factor divides `factor`, a power of two, or the full image.
  // kChanged: a file of the image is gone or was replaced. kUnavailable: it cannot be opened.
  Result<Borrowed> Borrow(int factor);

  // The largest factor that ImageBins can average to from what is there.
  int MostAveraged() const;

  // As HandlePool's.
  Result<void> CheckUnchanged();
  const StampedFiles& files() const { return files_; }

 private:
  std::string path_;
  StampedFiles files_;
  std::vector<std::unique_ptr<Size>> sizes_;  // by factor, ascending
};

}  // namespace terrace::dem
