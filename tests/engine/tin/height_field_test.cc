#include "engine/tin/height_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

constexpr float kVoid = std::numeric_limits<float>::quiet_NaN();

TEST(HeightField, RefusesWhatCannotBeTriangulated) {
  EXPECT_FALSE(HeightField::Make(1, 5, std::vector<float>(5)));
  EXPECT_FALSE(HeightField::Make(5, 1, std::vector<float>(5)));
  EXPECT_FALSE(HeightField::Make(-2, -2, std::vector<float>(4)));
  EXPECT_FALSE(HeightField::Make(HeightField::kMaxSide + 1, 2, std::vector<float>(2 * (HeightField::kMaxSide + 1))));
  EXPECT_FALSE(HeightField::Make(2, 2, std::vector<float>(5)));
  const Result<HeightField> all_void = HeightField::Make(2, 2, std::vector<float>(4, kVoid));
  ASSERT_FALSE(all_void);
  EXPECT_EQ(all_void.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(all_void.error().message, "all 2 x 2 samples of the height field are void: at least one needs a height");
}

TEST(HeightField, TakesInfinitiesForVoids) {
  const float infinity = std::numeric_limits<float>::infinity();
  const Result<HeightField> field = HeightField::Make(2, 2, {1, infinity, -infinity, kVoid});
  ASSERT_TRUE(field);
  EXPECT_TRUE(field->has_voids());
  EXPECT_EQ(field->At(0, 0), 1);
  EXPECT_TRUE(std::isnan(field->At(1, 0)) && std::isnan(field->At(0, 1)) && std::isnan(field->At(1, 1)));
  EXPECT_FALSE(NoiseField(2, 2, 1).has_voids());
}

TEST(HeightField, LendsAVoidVertexTheNearestHeight) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const int width = 2 + random.Below(12), height = 2 + random.Below(12), valid_percent = 1 + random.Below(40);
    int valid = 0;
    const HeightField field = MakeField(width, height, [&](int x, int y) {
      const bool last_chance = valid == 0 && x == width - 1 && y == height - 1;
      if (!last_chance && random.Below(100) >= valid_percent) return kVoid;
      ++valid;
      return static_cast<float>(y * width + x);
    });
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        int nearest = std::numeric_limits<int>::max();
        float expected = 0;
        for (int row = 0; row < height; ++row) {
          for (int column = 0; column < width; ++column) {
            const int distance = (column - x) * (column - x) + (row - y) * (row - y);
            if (std::isnan(field.At(column, row)) || distance >= nearest) continue;
            nearest = distance;
            expected = field.At(column, row);
          }
        }
        ASSERT_EQ(field.VertexHeight(x, y), expected);
      }
    }
  }
}

TEST(HeightField, FindsTheNearestHeightAcrossWideVoids) {
  Random random(6);
  for (int i = 0; i < 30; ++i) {
    const int width = 2 + random.Below(400), height = 2 + random.Below(300);
    std::vector<std::pair<int, int>> valid;
    for (int k = 0; k < 6; ++k) valid.push_back({random.Below(width), random.Below(height)});
    valid.push_back({width - 1 - valid[0].first, valid[0].second});  // ties are likely half way between them
    std::vector<float> heights(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), kVoid);
    for (const auto& [x, y] : valid)
      heights[static_cast<std::size_t>(y * width + x)] = static_cast<float>(y * width + x);
    const Result<HeightField> field = HeightField::Make(width, height, heights);
    ASSERT_TRUE(field);
    for (int k = 0; k < 300; ++k) {
      const int x = k % 3 == 0 ? (width - 1) / 2 : random.Below(width), y = random.Below(height);
      std::pair<int, int> nearest{std::numeric_limits<int>::max(), 0};  // squared distance, index
      for (const auto& [column, row] : valid) {
        nearest = std::min(nearest, {(column - x) * (column - x) + (row - y) * (row - y), row * width + column});
      }
      ASSERT_EQ(field->VertexHeight(x, y), static_cast<float>(nearest.second)) << x << ", " << y;
    }
  }
}

}  // namespace
}  // namespace terrace::tin
