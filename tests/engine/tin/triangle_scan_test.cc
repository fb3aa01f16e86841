#include "engine/tin/scan/triangle_scan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/predicates.h"
#include "tests/engine/tin/instruction_sets.h"
#include "tests/engine/tin/scan_reference.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

HeightField WithVoids(const HeightField& field, int voids, Random& random) {
  std::vector<SamplePosition> at;
  while (voids-- > 0) at.push_back(RandomSample(random, field));
  std::vector<bool> is_void(static_cast<std::size_t>(field.width() * field.height()));
  for (const auto [x, y] : at) is_void[static_cast<std::size_t>(y * field.width() + x)] = true;
  is_void[0] = false;  // otherwise the smallest field would be empty
  return MakeField(field.width(), field.height(), [&](int x, int y) {
    const bool is_one = is_void[static_cast<std::size_t>(y * field.width() + x)];
    return is_one ? std::numeric_limits<float>::quiet_NaN() : field.At(x, y);
  });
}

// Multiples of a quantum: from a range in which single precision is always exact to one in which it never is. Between
// them it depends on the triangle.
HeightField RoundedField(int width, int height, int kind, std::uint64_t seed) {
  const float quantum = kind % 3 == 0 ? 1.0F : kind % 3 == 1 ? 0x1p-10F : 0x1p-14F;
  const double most = quantum * std::ldexp(1.0, 4 + kind / 3 % 20);
  Random random(seed);
  return MakeField(width, height,
                   [&](int, int) { return static_cast<float>(std::floor(random.Unit() * most / quantum)) * quantum; });
}

TEST(TriangleScan, EqualsTheFormulaOnEveryTargetBitForBit) {
  Random random(3);
  for (int i = 0; i < 6000; ++i) {
    // From boxes of a few samples to spans of several vectors, with ties and without.
    const int side = 3 + random.Below(i % 3 == 0 ? 80 : 12);
    const int width = side + random.Below(side), height = side + random.Below(side);
    const auto seed = static_cast<std::uint64_t>(i);
    const HeightField field = i % 2 == 0   ? StepField(width, height, 3, seed)
                              : i % 4 == 1 ? NoiseField(width, height, seed)
                                           : RoundedField(width, height, i, seed);
    const int voids = i % 8 < 4 ? random.Below(width * height / 4) : 0;  // scans do not use integers if there are voids
    ExpectReferenceAtRandom(random, WithVoids(field, voids, random));
    if (HasFatalFailure()) return;
  }
}

// Triangles whose numerators are from well below to well above 32 bits.
TEST(TriangleScan, CountsInIntegersWhereTheyHoldAllNumerators) {
  Random random(17);
  int held = 0, not_held = 0;
  for (int i = 0; i < 900; ++i) {
    const double relief = std::ldexp(1.0, 14 + i % 9);  // quanta
    const HeightField field = MakeField(90, 80, [&](int x, int y) {
      const double quanta = x + y == 0 ? 1 : random.Below(4) == 0 ? relief - 1 : std::floor(random.Unit() * 9);
      return static_cast<float>(quanta * 0x1p-10);
    });
    ASSERT_EQ(field.quantum(), 0x1p-10F);
    const SamplePosition p = RandomSample(random, field), u = RandomSample(random, field),
                         v = RandomSample(random, field);
    if (Orientation(p, u, v) <= 0) continue;
    (static_cast<double>(Orientation(p, u, v)) <= static_cast<double>(field.max_integer_area()) ? held : not_held)++;
    ExpectReference(field, *TestStar(field, p, {u, v}));
    ASSERT_FALSE(HasFatalFailure()) << "relief " << relief;
  }
  EXPECT_GT(held, 100);
  EXPECT_GT(not_held, 40);
}

// Boxes from one vector of columns to spans of several, with the furthest sample in the first or the last column, in
// single precision, in integers and with rounding doubts.
TEST(TriangleScan, SeesTheFirstAndTheLastColumnOfBoxesOfAnyWidth) {
  const auto at = [](int x, int y) {
    return SamplePosition{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
  };
  for (const float base : {0.0F, 0x1p-10F, 0.37F}) {
    for (int reach = 2; reach <= 70; ++reach) {
      const int end = 1 + reach;
      for (const int column : {1, end}) {
        const HeightField field = MakeField(reach + 4, reach + 4, [&](int x, int y) {
          if (x == 0 && y == 0) return base;  // single precision is exact with it, or not
          if (x == column && y == 1 + reach / 2) return 5.0F;
          return x == 1 + reach / 2 && y == 1 + reach / 2 ? 1.0F : 0.0F;
        });
        ExpectReference(field, column == end ? *TestStar(field, at(1, 1), {at(end, 1), at(end, end)})
                                             : *TestStar(field, at(1, 1), {at(end, 1), at(1, end)}));
        ASSERT_FALSE(HasFatalFailure()) << "columns " << reach + 1;
      }
    }
  }
}

// A star around a centre whose outline is a rectangle without most of its samples, so that it has triangles of all
// sizes.
TestStar RectangularStar(const HeightField& field, Random& random) {
  const int x = 1 + random.Below(field.width() - 2), y = 1 + random.Below(field.height() - 2);
  const int most = 1 + random.Below(random.Below(2) == 0 ? 8 : std::max(field.width(), field.height()));
  const int west = std::max(x - most, 0), east = std::min(x + most, field.width() - 1);
  const int south = std::max(y - most, 0), north = std::min(y + most, field.height() - 1);
  const int kept = 1 + random.Below(3 + most / 4);  // one in this many
  std::vector<SamplePosition> ring;
  const auto put = [&](int at_x, int at_y, bool is_corner) {
    if (!is_corner && random.Below(kept) != 0) return;
    ring.push_back({static_cast<std::uint16_t>(at_x), static_cast<std::uint16_t>(at_y)});
  };
  for (int i = west; i < east; ++i) put(i, south, i == west);
  for (int i = south; i < north; ++i) put(east, i, i == south);
  for (int i = east; i > west; --i) put(i, north, i == east);
  for (int i = north; i > south; --i) put(west, i, i == north);
  ring.push_back(ring.front());
  const SamplePosition centre = {static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y)};
  return {field, centre, ring};
}

// Noise, spikes on a plain of zeros, spikes on a slope, steps, and different magnitudes within one field, with both
// signs and some voids.
HeightField ExtremeField(int width, int height, int kind, float scale, Random& random) {
  const int voids = kind % 3 == 0 ? 2 : 0;  // of 16
  return MakeField(width, height, [&](int x, int y) {
    const float unit = static_cast<float>(2 * random.Unit() - 1);
    const bool is_spike = random.Below(12) == 0;
    if (random.Below(16) < voids && x != 1 && y != 1) return std::numeric_limits<float>::quiet_NaN();
    switch (kind % 5) {
      case 0:
        return scale * unit;
      case 1:
        return is_spike ? scale * unit : 0.0F;
      case 2:
        return is_spike ? scale * unit : scale * (0x1p-12F * static_cast<float>(x) - 0x1p-13F * static_cast<float>(y));
      case 3:
        return scale * static_cast<float>(random.Below(4) - 2) * 0.5F;
      default:
        return std::ldexp(scale, -random.Below(60)) * unit;
    }
  });
}

// The rounding bound is relative to the corners' heights, not to the samples' distances: at 1e30 it is far larger than
// the distances of samples between two corners. Beyond 1e30 floats overflow, and denormals have few digits.
TEST(TriangleScan, EqualsTheFormulaWhateverTheMagnitude) {
  constexpr float kLargest = std::numeric_limits<float>::max();
  constexpr float kDenormal = std::numeric_limits<float>::denorm_min();
  constexpr std::array kScales = {
      1.0F,     1e8F,   1e20F,     0x1p80F, 0x1p96F, 1e30F,     1e34F,         1e38F,
      kLargest, 1e-30F, 0x1p-125F, 1e-38F,  1e-42F,  kDenormal, 9 * kDenormal, 0x1p-149F * 0x1p22F};
  Random random(7);
  for (int i = 0; i < 1200; ++i) {
    const float scale = kScales[static_cast<std::size_t>(random.Below(kScales.size()))];
    const int side = 3 + random.Below(i % 4 == 0 ? 80 : 12);
    // Some triangles are too wide for an inside test in single precision.
    const int width = i % 200 == 0 ? 2100 + random.Below(90) : side + random.Below(side);
    const HeightField field =
        WithVoids(ExtremeField(width, i % 200 == 0 ? 5 : side + random.Below(side), i, scale, random),
                  random.Below(3) * random.Below(side * side / 4), random);
    const TestStar star = RectangularStar(field, random);
    ExpectReference(field, *star);
    ASSERT_FALSE(HasFatalFailure()) << "field " << i << ", scale " << scale;
  }
}

// Columns of a row of a triangle, by its exact barycentric coordinates; none if the first is beyond the last.
std::array<int, 2> SpanOf(const std::array<SamplePosition, 3>& corners, int row) {
  std::array<int, 2> span = {std::numeric_limits<int>::max(), -1};
  const int west = std::min({corners[0].x, corners[1].x, corners[2].x});
  const int east = std::max({corners[0].x, corners[1].x, corners[2].x});
  for (int column = west; column <= east; ++column) {
    const SamplePosition at{static_cast<std::uint16_t>(column), static_cast<std::uint16_t>(row)};
    if (Orientation(corners[0], corners[1], at) < 0 || Orientation(corners[1], corners[2], at) < 0 ||
        Orientation(corners[2], corners[0], at) < 0) {
      continue;
    }
    span = {std::min(span[0], column), column};
  }
  return span;
}

// All samples are void except the ends of one row's span, which must be found, and the samples beyond them with larger
// distances, which must not. The rows of the field have padding.
TEST(TriangleScan, SeesTheEndsOfLongSpansAndNothingBeyond) {
  Random random(11);
  int tried = 0;
  for (int i = 0; i < 120; ++i) {
    const bool is_large = i % 12 == 0;
    const int width = is_large ? 2050 : 513 + random.Below(200), height = is_large ? 40 : 60 + random.Below(300);
    const auto inside = [&] {
      return SamplePosition{static_cast<std::uint16_t>(1 + random.Below(width - 2)),
                            static_cast<std::uint16_t>(1 + random.Below(height - 2))};
    };
    std::array<SamplePosition, 3> corners = {inside(), inside(), inside()};
    if (is_large) corners[1].x = 1, corners[2].x = static_cast<std::uint16_t>(width - 2);
    if (i % 3 == 0) corners[2].y = static_cast<std::uint16_t>(std::min(corners[1].y + 1, height - 2));  // thin
    if (Orientation(corners[0], corners[1], corners[2]) < 0) std::swap(corners[1], corners[2]);
    if (Orientation(corners[0], corners[1], corners[2]) == 0) continue;
    const int row = corners[static_cast<std::size_t>(random.Below(3))].y + random.Below(9) - 4;
    if (row < 1 || row > height - 2) continue;
    const auto [first, last] = SpanOf(corners, row);
    const float base = i % 2 == 0 ? 0 : 0.37F;  // exact in single precision, or not
    const HeightField field = MakeField(width, height, [&, first = first, last = last](int x, int y) {
      for (const SamplePosition corner : corners) {
        if (x == corner.x && y == corner.y) return base;
      }
      if (y != row) return std::numeric_limits<float>::quiet_NaN();
      if (first > last) return base + 9;
      return x == first ? base + 1 : x == last ? base + 2 : x == first - 1 || x == last + 1 ? base + 9 : base;
    });
    ExpectReference(field, *TestStar(field, corners[0], {corners[1], corners[2]}));
    ASSERT_FALSE(HasFatalFailure()) << "triangle " << i;
    ++tried;
  }
  EXPECT_GT(tried, 60);
}

TEST(TriangleScan, ScansStarsOfAnySize) {
  const HeightField field = NoiseField(101, 101, 4);
  std::vector<SamplePosition> ring;
  for (std::uint16_t x = 0; x <= 100; x += 4) ring.push_back({x, 0});
  for (std::uint16_t y = 3; y <= 100; y += 7) ring.push_back({100, y});
  for (std::size_t count = 2; count <= ring.size(); ++count) {
    ExpectReference(field,
                    *TestStar(field, {40, 60}, {ring.begin(), ring.begin() + static_cast<std::ptrdiff_t>(count)}));
    if (HasFatalFailure()) return;
  }
}

// Skipped entries may have any corners: a ring may contain several fans in sequence.
TEST(TriangleScan, LeavesOutWhatIsNoTriangle) {
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    Random random(seed);
    const HeightField field = NoiseField(24, 24, seed);
    const SamplePosition p = RandomSample(random, field);
    std::vector<SamplePosition> ring = {RandomSample(random, field)};
    std::uint32_t left_out = 0;
    for (int i = random.Below(static_cast<int>(Star::kMaxLeftOut)); i >= 0; --i) {
      const SamplePosition next = RandomSample(random, field);
      const bool is_left_out = Orientation(p, ring.back(), next) <= 0 || random.Below(4) == 0;
      left_out |= std::uint32_t{is_left_out} << (ring.size() - 1);
      ring.push_back(next);
    }
    Star star = *TestStar(field, p, ring);
    star.left_out = left_out;
    ForEachInstructionSet([&] {
      std::vector<PlaneMisfit> misfits(star.count);
      BestStarScan()(field, star, misfits.data());
      for (std::size_t i = 0; i < star.count; ++i) {
        if (star.IsLeftOut(i)) continue;
        const PlaneMisfit expected = Reference(field, star, i);
        ASSERT_EQ(misfits[i].distance, expected.distance) << seed << ", triangle " << i;
        ASSERT_EQ(misfits[i].sample, expected.sample) << seed << ", triangle " << i;
      }
    });
  }
}

TEST(TriangleScan, ReachesTheLargestTriangleOfTheLongestField) {
  constexpr int kLength = HeightField::kMaxSide;
  const HeightField field = MakeField(kLength, 3, [](int x, int y) { return x == kLength - 3 && y == 1 ? 9.f : 0.f; });
  const HeightField upright =
      MakeField(3, kLength, [](int x, int y) { return y == kLength - 3 && x == 1 ? 9.f : 0.f; });
  const std::uint16_t last = kLength - 1;
  ExpectReference(field, *TestStar(field, {0, 0}, {{last, 0}, {last, 2}}));
  ExpectReference(upright, *TestStar(upright, {0, 0}, {{2, 0}, {2, last}}));
}

TEST(TriangleScan, SkipsVoidsAndTheBorder) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const HeightField field = MakeField(5, 5, [&](int x, int y) {
    return x == 2 && y == 1 ? nan : x == 3 && y == 1 ? 7.f : x == 4 && y == 1 ? 99.f : 0.f;
  });
  PlaneMisfit worst;
  BestStarScan()(field, *TestStar(field, {4, 4}, {{0, 0}, {4, 0}}), &worst);
  EXPECT_EQ(worst.distance, 7);
  EXPECT_EQ(worst.sample, SampleNumber(3, 1));
}

// Corners are on the plane up to the rounding of floats; border samples are anywhere. All others are void, except
// possibly one sample on the plane.
TEST(TriangleScan, TakesNoCornerForASample) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr std::array kScales = {1.0F, 0.37F, 1e8F, 1e30F, 1e38F, 1e-30F, 1e-42F};
  Random random(13);
  for (int i = 0; i < 3000; ++i) {
    const int most = i % 5 == 0 ? 90 : 12;
    const int width = i % 300 == 0 ? 2100 : 3 + random.Below(most), height = 3 + random.Below(most);
    const float scale = kScales[static_cast<std::size_t>(random.Below(kScales.size()))];
    const HeightField heights = MakeField(width, height, [&](int, int) {
      return std::ldexp(scale, -random.Below(i % 2 == 0 ? 1 : 20)) * static_cast<float>(random.Below(3) - 1);
    });
    std::array<SamplePosition, 3> corners;
    for (SamplePosition& corner : corners) corner = RandomSample(random, heights);
    if (Orientation(corners[0], corners[1], corners[2]) < 0) std::swap(corners[1], corners[2]);
    if (Orientation(corners[0], corners[1], corners[2]) == 0) continue;
    const SamplePosition other = RandomSample(random, heights);
    const HeightField field = MakeField(width, height, [&](int x, int y) {
      const auto is_at = [&](SamplePosition at) { return at.x == x && at.y == y; };
      const bool is_border = x == 0 || y == 0 || x + 1 == width || y + 1 == height;
      const bool is_left =
          is_border || std::any_of(corners.begin(), corners.end(), is_at) || (i % 3 == 0 && is_at(other));
      return is_left ? heights.At(x, y) : nan;
    });
    ExpectReference(field, *TestStar(field, corners[0], {corners[1], corners[2]}));
    ASSERT_FALSE(HasFatalFailure()) << "field " << i << ", scale " << scale;
  }
}

TEST(TriangleScan, TellsWhenThereIsNothingToScan) {
  const HeightField field = NoiseField(6, 6, 1);
  PlaneMisfit worst;
  BestStarScan()(field, *TestStar(field, {1, 1}, {{2, 1}, {1, 2}}), &worst);
  EXPECT_LT(worst.distance, 0);
  EXPECT_EQ(worst.sample, kNoSample);
}

TEST(TriangleScan, HasSeveralTargetsToCompare) {
  // On x86 the baseline and the processor's sets; elsewhere at least one.
  int sets = 0;
  ForEachInstructionSet([&] { ++sets; });
  EXPECT_GE(sets, 1);
  RecordProperty("targets", sets);
}

}  // namespace
}  // namespace terrace::tin
