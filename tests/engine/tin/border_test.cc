#include "engine/tin/border.h"

#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cmath>
#include <limits>
#include <vector>

#include "engine/tin/greedy.h"
#include "tests/engine/tin/instruction_sets.h"
#include "tests/engine/tin/mesh_laws.h"
#include "tests/engine/tin/naive_greedy.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

TEST(Border, JudgesASampleByItsChord) {
  const HeightField field = MakeField(5, 3, [](int x, int y) { return y == 0 ? static_cast<float>(x * x) : 0.f; });
  const Corner west{0, 0, 0}, east{4, 0, 16};
  EXPECT_EQ(SideOf(field, west, east), Side::kSouth);
  EXPECT_EQ(WorstBorderSample(field, west, east, {}), (Candidate{4, 2}));
  EXPECT_EQ(WorstBorderSample(field, east, west, {}), (Candidate{4, 2}));
  BorderOptions options;
  options.sagitta_m = 0.5;
  options.weight = 3;
  EXPECT_EQ(WorstBorderSample(field, west, east, options), (Candidate{18, 2}));
  options.padding_m = 1;
  EXPECT_EQ(WorstBorderSample(field, west, east, options), (Candidate{21, 2}));
  options.step_m = 16;
  EXPECT_EQ(WorstBorderSample(field, west, east, options), (Candidate{23, 2}));
  options.step_m = 50;
  options.scale = 2;
  EXPECT_EQ(WorstBorderSample(field, west, east, options), (Candidate{48, 2}));  // kMaxBorderWeight
  EXPECT_EQ(SquaredBorderDistances(field, west, east), 9 + 16 + 9);
}

// The rule, sample by sample.
Candidate WorstOneByOne(const HeightField& field, const Corner& a, const Corner& b, const BorderOptions& options) {
  const bool along_x = a.y == b.y;
  const int from = along_x ? a.x : a.y, to = along_x ? b.x : b.y;
  Candidate worst;
  for (int k = from + 1; k < to; ++k) {
    const int x = along_x ? k : a.x, y = along_x ? a.y : k;
    const double chord = (a.z * (to - k) + b.z * (k - from)) / (to - from);
    const double misfit =
        std::abs(chord - static_cast<double>(field.At(x, y))) + options.sagitta_m * (k - from) * (to - k);
    const double error = BorderError(misfit, options);
    if (error > worst.error) worst = {error, SampleNumber(x, y)};
  }
  return worst;
}

// On all sides, for chords of all lengths, with voids and equal errors. The rows of the wider field have padding.
TEST(Border, JudgesInVectorsAsOneByOne) {
  ForEachInstructionSet([] {
    Random random(7);
    for (int round = 0; round < 440; ++round) {
      const int width = round % 11 == 0 ? 1024 : 41, height = 37;
      const int voids_percent = random.Below(3) * 30, steps = 2 + random.Below(2) * 1000;
      const HeightField field = MakeField(width, height, [&](int x, int y) {
        const bool is_void = x + y > 0 && random.Below(100) < voids_percent;
        return is_void ? kVoid : static_cast<float>(random.Below(steps)) / 8;
      });
      const bool along_x = random.Below(2) == 0;
      const int size = along_x ? width : height, across = random.Below(2) * ((along_x ? height : width) - 1);
      const int from = random.Below(size - 1), to = from + 1 + random.Below(size - from - 1);
      const auto corner = [&](int k) -> Corner {
        const int x = along_x ? k : across, y = along_x ? across : k;
        return {x, y, static_cast<double>(field.VertexHeight(x, y))};
      };
      BorderOptions options;
      options.weight = 1 + random.Below(3) * 0.7;
      options.padding_m = random.Below(2) * 0.2;
      options.step_m = random.Below(2) * 0.1;
      options.sagitta_m = random.Below(2) * 0.003;
      options.scale = 1 + random.Below(2) * 0.3;
      const Corner a = corner(from), b = corner(to);
      const Candidate worst = WorstOneByOne(field, a, b, options);
      ASSERT_EQ(WorstBorderSample(field, a, b, options), worst) << round;
      ASSERT_EQ(WorstBorderSample(field, b, a, options), worst) << round;
    }
  });
}

TEST(Border, JudgesSumsThatOverflowAsOneByOne) {
  const HeightField field = MakeField(5, 3, [](int x, int) { return static_cast<float>(x * x); });
  const Corner west{0, 0, 0}, east{4, 0, 16};
  for (const double weight : {0.0, 1.0}) {
    BorderOptions options;
    options.weight = weight;
    options.sagitta_m = 1e308;
    const Candidate worst = WorstOneByOne(field, west, east, options);
    ForEachInstructionSet([&] { ASSERT_EQ(WorstBorderSample(field, west, east, options), worst) << weight; });
  }
}

// The page after the last sample between the ends must not be read.
TEST(Border, ReadsNothingBeyondTheChord) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  void* const pages = mmap(nullptr, 2 * page, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(pages, MAP_FAILED);
  auto* const beyond = reinterpret_cast<float*>(static_cast<char*>(pages) + page);
  ASSERT_EQ(mprotect(beyond, page, PROT_NONE), 0);
  for (const int stride : {1, 3, 17}) {
    for (int length = 1; length <= 40; ++length) {
      const float* const heights = beyond - (length - 1) * stride - 1;
      const Chord chord{5, 5 + length, 0, 1, heights, stride};
      ForEachInstructionSet([&] { EXPECT_EQ(WorstOfChord(chord, {}).error > 0, length > 1) << length; });
    }
  }
  EXPECT_EQ(munmap(pages, 2 * page), 0);
}

TEST(Border, KnowsItsFourSides) {
  const HeightField field = NoiseField(4, 6, 1);
  EXPECT_EQ(SideOf(field, {0, 0, 0}, {3, 0, 0}), Side::kSouth);
  EXPECT_EQ(SideOf(field, {3, 5, 0}, {0, 5, 0}), Side::kNorth);
  EXPECT_EQ(SideOf(field, {3, 0, 0}, {3, 2, 0}), Side::kEast);
  EXPECT_EQ(SideOf(field, {0, 4, 0}, {0, 2, 0}), Side::kWest);
}

// The vertices of one border by one-dimensional greedy insertion, without triangles.
std::vector<int> SplitChord(const HeightField& field, int a, int b, double threshold, const BorderOptions& options) {
  const Corner low{0, a, static_cast<double>(field.At(0, a))}, high{0, b, static_cast<double>(field.At(0, b))};
  const Candidate worst = WorstBorderSample(field, low, high, options);
  if (worst.error <= threshold) return {a, b};
  const int k = PositionOf(worst.sample).y;
  std::vector<int> left = SplitChord(field, a, k, threshold, options);
  const std::vector<int> right = SplitChord(field, k, b, threshold, options);
  left.insert(left.end(), right.begin() + 1, right.end());
  return left;
}

TEST(Border, HasTheVerticesOfItsOwnOneDimensionalSimplification) {
  for (std::uint64_t seed = 0; seed < 6; ++seed) {
    const HeightField field = HillField(65, 65, seed);
    GreedyOptions options;
    options.borders.fill({.weight = 1.5, .padding_m = 0.3, .sagitta_m = 0.01});
    for (const double error : {40.0, 9.0, 2.0}) {
      GreedyTriangulation tin(field, options);
      EXPECT_TRUE(tin.Run({error}));
      EXPECT_EQ(BorderVertices(field, tin.Mesh(), Side::kWest), SplitChord(field, 0, 64, error, options.borders[3]));
    }
  }
}

// Fields that share only one border column, like neighbours in east-west direction.
TEST(Border, IsTheSameInBothNeighboursWhateverTheirInsides) {
  constexpr int kSide = 65;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Random random(seed);
    std::vector<float> shared;
    for (int y = 0; y < kSide; ++y)
      shared.push_back(seed % 3 == 0 ? static_cast<float>(random.Below(6)) : HillHeight(0, y, seed));
    const double roughness = std::pow(10, random.Below(4) - 1);
    const HeightField west = MakeField(kSide, kSide, [&](int x, int y) {
      return x == kSide - 1 ? shared[static_cast<std::size_t>(y)] : static_cast<float>(random.Unit() * roughness);
    });
    const HeightField east = MakeField(kSide, kSide, [&](int x, int y) {
      return x == 0 ? shared[static_cast<std::size_t>(y)] : HillHeight(x, y, seed + 100);
    });
    GreedyOptions options;
    options.borders.fill({.weight = 1 + random.Below(3) * 0.7,
                          .padding_m = random.Below(2) * 0.2,
                          .step_m = random.Below(2) * 0.1,
                          .sagitta_m = random.Below(2) * 0.003});
    if (seed % 2 == 1) options.seeds = {{40, 32}, {15, 16}, {6, 8}};
    if (seed % 4 == 1) options.curvature = {std::vector<double>(kSide, 900.0), 1000.0, 6.4e5};
    GreedyTriangulation west_tin(west, options), east_tin(east, options);
    for (const double error : {60.0, 20.0, 10.0, 5.0, 3.0, 1.0, 0.4}) {
      EXPECT_TRUE(west_tin.Run({error}));
      EXPECT_TRUE(east_tin.Run({error}));
      EXPECT_EQ(BorderVertices(west, west_tin.Mesh(), Side::kEast), BorderVertices(east, east_tin.Mesh(), Side::kWest))
          << error;
    }
  }
}

}  // namespace
}  // namespace terrace::tin
