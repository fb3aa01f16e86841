// One image for many threads, at full size and at the sizes of its overviews. Each ImageFile is used by one thread at a
// time. IdlePool keeps unused ones.
#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/common/idle_pool.h"
#include "engine/dem/gdal/file_stamp.h"
#include "engine/dem/image/image_file.h"

namespace terrace::dem {

// Thread-safe.
class ImagePool {
  struct Size;

 public:
  // An image that belongs to the holder until it goes out of scope.
  class Handle {
   public:
    Handle(Size& size, IdlePool<ImageFile>::Taken image) : size_(&size), image_(std::move(image)) {}
    Handle(Handle&&) = default;
    Handle& operator=(Handle&&) = delete;
    ~Handle() {
      if (image_.item != nullptr) size_->idle.Keep(std::move(image_));
    }
    ImageFile& operator*() const { return *image_.item; }
    int factor() const { return size_->factor; }
    // Pixels of the full image per pixel of this one: the factor, or slightly less.
    double pixels_across() const { return size_->across; }
    double pixels_down() const { return size_->down; }

   private:
    Size* size_;
    IdlePool<ImageFile>::Taken image_;
  };

  ImagePool(ImageFile image, StampedFiles files);

  // Borrows the smallest overview whose factor divides `factor`, a power of two; else the full image. kChanged: a file
  // of the image was removed or replaced. kUnavailable: it cannot be opened.
  Result<Handle> Borrow(int factor);

  // The largest factor that ImageBins can average to from the available sizes.
  int MostAveraged() const;

  // As HandlePool::CheckUnchanged.
  Result<void> CheckUnchanged();
  const StampedFiles& files() const { return files_; }

 private:
  struct Size {
    int factor = 1;
    int overview = -1;            // GDAL's number of it; -1: the full image
    double across = 1, down = 1;  // Handle::pixels_across, pixels_down
    IdlePool<ImageFile> idle = {};
  };

  std::string path_;
  StampedFiles files_;
  std::vector<std::unique_ptr<Size>> sizes_;  // by factor, ascending
};

}  // namespace terrace::dem
