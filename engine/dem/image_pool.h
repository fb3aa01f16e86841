// One image for many threads, at full size and by its overviews: each ImageFile is used by one thread at a time.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/file_stamp.h"
#include "engine/dem/image_file.h"

namespace terrace::dem {

// Thread-safe.
class ImagePool {
 public:
  // An image that belongs to the holder until it goes out of scope.
  class Handle {
   public:
    Handle(ImagePool& pool, std::size_t size, ImageFile image, std::uint64_t epoch)
        : pool_(&pool), size_(size), image_(std::make_unique<ImageFile>(std::move(image))), epoch_(epoch) {}
    Handle(Handle&&) = default;
    Handle& operator=(Handle&&) = delete;
    ~Handle() {
      if (image_ != nullptr) pool_->Return(size_, std::move(*image_), epoch_);
    }
    ImageFile& operator*() const { return *image_; }
    int factor() const { return pool_->sizes_[size_].factor; }
    // Pixels of the full image in one of this: the factor, or a little less.
    double pixels_across() const { return pool_->sizes_[size_].across; }
    double pixels_down() const { return pool_->sizes_[size_].down; }

   private:
    ImagePool* pool_;
    std::size_t size_;
    std::unique_ptr<ImageFile> image_;
    std::uint64_t epoch_;
  };

  ImagePool(ImageFile image, StampedFiles files);
  // Only before the first Borrow.
  ImagePool(ImagePool&& other) noexcept;

  // The smallest of the overviews whose factor divides `factor`, a power of two, or the full image.
  // kChanged: a file of the image is gone or was replaced. kUnavailable: it cannot be opened.
  Result<Handle> Borrow(int factor);

  // The largest factor that ImageBins can average to from what is there.
  int MostAveraged() const;

  Result<void> CheckUnchanged();
  const StampedFiles& files() const { return files_; }

 private:
  struct Size {
    int factor = 1;
    int overview = -1;            // GDAL's number of it; -1: the full image
    double across = 1, down = 1;  // Handle::pixels_across, pixels_down
  };

  void Return(std::size_t size, ImageFile image, std::uint64_t epoch);

  std::string path_;
  StampedFiles files_;
  std::vector<Size> sizes_;  // by factor, ascending
  std::mutex mutex_;
  std::vector<std::vector<ImageFile>> idle_;  // by size; guarded by mutex_
  std::uint64_t epoch_ = 0;                   // as in HandlePool; guarded by mutex_
};

}  // namespace terrace::dem
