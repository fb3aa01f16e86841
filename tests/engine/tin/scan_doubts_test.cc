// Scans in which single precision cannot distinguish samples.
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <vector>

#include "engine/tin/mesh/height_field.h"
#include "tests/engine/tin/scan_reference.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

// Slopes of a fraction of a metre: all samples but a few are on the triangles' planes up to the rounding of floats, so
// that in single precision many can be the furthest. Also heights that overflow single precision.
TEST(TriangleScan, TellsApartWhatSinglePrecisionDoesNot) {
  Random random(5);
  for (int i = 0; i < 200; ++i) {
    const int side = i % 2 == 0 ? 9 : 70;
    const float height = i % 7 == 0 ? 1e36F : 1000.1F;
    const int bumps = random.Below(4);
    const HeightField field = MakeField(side, side, [&](int x, int y) {
      const bool is_bump = bumps > 0 && (x * 31 + y * 17 + i) % (side * bumps) == 0;
      return height * (1 + 0.37e-3F * static_cast<float>(x) + 0.11e-3F * static_cast<float>(y)) *
             (is_bump ? 1.0000002F : 1.0F);
    });
    ExpectReferenceAtRandom(random, field);
    if (HasFatalFailure()) return;
  }
}

// Two to four samples that only double precision distinguishes, in columns of the same vector lane, in one row of
// vectors or in several.
TEST(TriangleScan, TellsApartWhatSharesALane) {
  Random random(23);
  for (int i = 0; i < 3000; ++i) {
    const int reach = 8 + random.Below(60), size = reach + 4, lane = random.Below(16);
    std::vector<float> heights(static_cast<std::size_t>(size * size), std::numeric_limits<float>::quiet_NaN());
    const float base = 1 + static_cast<float>(random.Unit());
    for (int k = 2 + random.Below(3); k > 0; --k) {
      const int column = 2 + lane + 16 * random.Below(4), row = 2 + random.Below(reach);
      if (column >= size) continue;
      heights[static_cast<std::size_t>(row * size + column)] =
          base * (1 + static_cast<float>(random.Below(4)) * 0x1p-23F);
    }
    const std::array<std::array<int, 2>, 3> corners = {
        {{1, 1}, {1 + reach, 1}, {1 + random.Below(reach + 1), 1 + reach}}};
    for (const auto [x, y] : corners) heights[static_cast<std::size_t>(y * size + x)] = 0;
    const HeightField field =
        MakeField(size, size, [&](int x, int y) { return heights[static_cast<std::size_t>(y * size + x)]; });
    const auto corner = [&](std::size_t k) {
      return SamplePosition{static_cast<std::uint16_t>(corners[k][0]), static_cast<std::uint16_t>(corners[k][1])};
    };
    ExpectReference(field, *TestStar(field, corner(0), {corner(1), corner(2)}));
    ASSERT_FALSE(HasFatalFailure()) << i;
  }
}

// Planes whose steps round in opposite directions at two samples with almost equal distances, found by a search for the
// largest error of a block's single precision. With a rounding bound of 2^-20 in blocks the wrong sample of the first
// one would win with vectors of eight lanes.
TEST(TriangleScan, TellsApartWhatStepsOfPlanesBlur) {
  struct Case {
    float pz, uz, vz, at_39, at_38;
  };
  constexpr std::array kCases = {
      Case{0x1.8dc9e8p-2F, -0x1.d17ffep-17F, 0x1.8dcca8p-2F, 0x1.c683acp-5F, 0x1.c688d4p-5F},
      Case{-0x1.0d56cp-13F, 0x1.97c29ep-7F, 0x1.14aefep-21F, 0x1.5ce6ccp-7F, 0x1.5d8466p-7F},
      Case{-0x1.8a8d3p-5F, 0x1.7f319ep+0F, 0x1.2e8b8p-12F, 0x1.46af3cp+0F, 0x1.4877e6p+0F},
  };
  for (const Case& heights : kCases) {
    for (int k = -40; k <= 40; ++k) {
      const auto varied = [k](float height) { return height * (1 + static_cast<float>(k) * 0x1p-23F); };
      const HeightField field = MakeField(12, 12, [&](int x, int y) {
        if (x == 9 && y == 9) return heights.pz;
        if (x == 2 && y == 9) return heights.uz;
        if (x == 9 && y == 2) return heights.vz;
        if (x == 3 && y == 9) return varied(heights.at_39);
        return x == 3 && y == 8 ? heights.at_38 : std::numeric_limits<float>::quiet_NaN();
      });
      ExpectReference(field, *TestStar(field, {9, 9}, {{2, 9}, {9, 2}}));
      ASSERT_FALSE(HasFatalFailure()) << k;
    }
  }
}

// The plane rises to a spike from two zeros, and the sample on the edge between the zeros is on it. Its distance is 0,
// and the rounding bound is 2^-20 of the spike, below the limit for a sample outside.
TEST(TriangleScan, TakesNoSampleFromOutsideWhereDoubtsAreLarge) {
  for (const int reach : {2, 6, 40}) {
    const HeightField field = MakeField(2 * reach + 5, reach + 4, [&](int x, int y) {
      if (x == reach && y == 1 + reach) return 1e25F;
      if (x > 0 && x < 1 + reach && y > 1 && y < 1 + reach) return std::numeric_limits<float>::quiet_NaN();
      return y == 1 || x % 2 == 0 ? 0.0F : 0.1F;
    });
    const auto at = [](int x, int y) {
      return SamplePosition{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
    };
    const SamplePosition p = at(1, 1), u = at(1 + reach, 1), spike = at(reach, 1 + reach);
    ExpectReference(field, *TestStar(field, p, {u, spike}));
    if (HasFatalFailure()) return;
  }
}

}  // namespace
}  // namespace terrace::tin
