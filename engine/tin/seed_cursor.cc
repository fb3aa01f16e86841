#include "engine/tin/seed_cursor.h"

#include <cstdint>
#include <utility>

#include "engine/core/check.h"

namespace terrace::tin {

SeedCursor::SeedCursor(const HeightField& field, std::vector<SeedGrid> grids)
    : width_(field.width()), height_(field.height()), grids_(std::move(grids)) {
  for (std::size_t i = 0; i < grids_.size(); ++i) {
    const int step = grids_[i].step;
    TERRACE_CHECK(step > 0 && (width_ - 1) % step == 0 && (height_ - 1) % step == 0);
    TERRACE_CHECK(i == 0 || grids_[i - 1].below_error >= grids_[i].below_error);
  }
}

SamplePosition SeedCursor::Take() {
  const SamplePosition sample{static_cast<std::uint16_t>(x_), static_cast<std::uint16_t>(y_)};
  const int step = grids_[grid_].step;
  begun_ = true;
  x_ += step;
  if (x_ < width_) return sample;
  x_ = 0;
  y_ += step;
  if (y_ < height_) return sample;
  y_ = 0;
  begun_ = false;
  ++grid_;
  return sample;
}

}  // namespace terrace::tin
