#include "tiler/mesh/refine_options.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <iterator>
#include <vector>

#include "engine/geo/tile_key.h"

namespace terrace::tiler {
namespace {

// Sagitta requires this. At the equator of deep levels rows differ by less than rounding.
TEST(RefineOptions, HasOneWidestRow) {
  for (const int cells : {32, 256}) {
    const std::vector<float> heights(static_cast<std::size_t>((cells + 3) * (cells + 3)), 0.0F);
    for (int level = 0; level <= geo::kMaxLevel; ++level) {
      const std::int64_t rows = geo::TileRows(level), middle = rows / 2;
      for (std::int64_t y = std::max(middle - 20, std::int64_t{0}); y < std::min(middle + 20, rows); ++y) {
        const proto::TileSamples samples{{level, 0, y}, {level, cells}, heights};
        const std::vector<double> east_m2 = BaseRefineOptions(samples, {}).curvature.east_m2;
        const auto widest = std::max_element(east_m2.begin(), east_m2.end());
        ASSERT_TRUE(std::is_sorted(east_m2.begin(), widest)) << level << "/" << y;
        ASSERT_TRUE(std::is_sorted(east_m2.rbegin(), std::reverse_iterator(widest))) << level << "/" << y;
      }
    }
  }
}

}  // namespace
}  // namespace terrace::tiler
