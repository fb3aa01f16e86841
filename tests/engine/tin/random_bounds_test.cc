// The error bound and the coverage on thousands of small random fields, for every way to make a mesh.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/decimate/drop_pass.h"
#include "engine/tin/extended/block_joiner.h"
#include "engine/tin/extended/field_partition.h"
#include "engine/tin/greedy.h"
#include "tests/engine/tin/rasterizer.h"
#include "tests/engine/tin/test_fields.h"

namespace terrace::tin {
namespace {

constexpr std::uint64_t kFields = 1000;  // of each sort

enum class Sort { kNoise, kSteps, kSpikes, kCliff, kConstant, kMagnitudes };

float HeightOf(Sort sort, int x, int y, Random& random) {
  switch (sort) {
    case Sort::kNoise:
      return static_cast<float>(random.Unit()) - 0.5f;
    case Sort::kSteps:
      return static_cast<float>(random.Below(4));
    case Sort::kSpikes:
      return random.Below(12) == 0 ? static_cast<float>(random.Unit()) - 0.5f : 0.f;
    case Sort::kCliff:
      return 2 * x + 3 * y > 25 ? 1.f : 0.f;
    case Sort::kConstant:
      return 0.75f;
    case Sort::kMagnitudes:
      return static_cast<float>((random.Unit() - 0.5) * std::pow(10, random.Below(13) - 6));
  }
  return 0;
}

// Sizes from 2 x 2 to 20 x 20, some with voids, including infinities.
HeightField RandomField(Sort sort, float scale, Random& random) {
  const int width = 2 + random.Below(19), height = 2 + random.Below(19);
  const int voids = random.Below(3) * random.Below(5);  // of 16
  const int valid_x = random.Below(width), valid_y = random.Below(height);
  return MakeField(width, height, [&](int x, int y) {
    const float value = scale * HeightOf(sort, x, y, random);
    const bool is_void = random.Below(16) < voids && (x != valid_x || y != valid_y);
    if (!is_void) return value;
    return random.Below(4) == 0 ? std::numeric_limits<float>::infinity() : kVoid;
  });
}

TinMesh MeshInBlocks(const HeightField& field, int block_cells, double bound, const GreedyOptions& options) {
  const FieldPartition cut(field.width(), field.height(), block_cells);
  BlockJoiner joiner(cut);
  for (std::size_t i = 0; i < cut.size(); ++i) joiner.Add(*MeshBlock(field, cut.block(i), bound, options));
  return std::move(joiner).Take();
}

// Plain, compact, in blocks, and compact in blocks.
void ExpectBounds(const HeightField& field, const GreedyOptions& options, double bound, int block_cells) {
  GreedyTriangulation tin(field, options);
  ASSERT_TRUE(tin.Run({bound}));
  const TinMesh mesh = tin.Mesh(), joined = MeshInBlocks(field, block_cells, bound, options);
  for (const TinMesh* plain : {&mesh, &joined}) {
    const char* const way = plain == &joined ? "joined" : "whole";
    ASSERT_TRUE(Keeps(Rasterize(field, *plain), bound)) << way;
    const auto dropped = DropVertices(field, *plain, {.max_error = bound});
    ASSERT_TRUE(dropped.has_value());
    ASSERT_LE(dropped->vertices.size(), plain->vertices.size());
    ASSERT_TRUE(Keeps(Rasterize(field, *dropped), bound)) << way << ", compact";
  }
}

class RandomBounds : public testing::TestWithParam<std::pair<Sort, const char*>> {};

TEST_P(RandomBounds, HoldAtEverySample) {
  constexpr std::array kScales = {1.f, 100.f, 1e30f, 1e-30f, 1e-42f};
  constexpr std::array kMeasures = {FitMeasure::kSumMax, FitMeasure::kSumSquares, FitMeasure::kMaxMax,
                                    FitMeasure::kNormals};
  for (std::uint64_t seed = 0; seed < kFields; ++seed) {
    Random random(seed);
    const float scale = kScales[seed % kScales.size()];
    const HeightField field = RandomField(GetParam().first, scale, random);
    const double bound = random.Below(4) * 0.3 * random.Unit() * static_cast<double>(scale);
    GreedyOptions options;
    options.criterion = seed % 2 == 0 ? Criterion::kDelaunay : Criterion::kDataDependent;
    options.data_dependent.measure = kMeasures[seed / 2 % kMeasures.size()];
    options.data_dependent.qthresh = 0.25 * random.Below(5);
    const int block_cells = 1 + random.Below(9);
    ASSERT_NO_FATAL_FAILURE(ExpectBounds(field, options, bound, block_cells))
        << fmt::format("seed {}: {} x {}, bound {}", seed, field.width(), field.height(), bound);
  }
}

INSTANTIATE_TEST_SUITE_P(Fields, RandomBounds,
                         testing::Values(std::pair{Sort::kNoise, "noise"}, std::pair{Sort::kSteps, "steps"},
                                         std::pair{Sort::kSpikes, "spikes"}, std::pair{Sort::kCliff, "cliff"},
                                         std::pair{Sort::kConstant, "constant"},
                                         std::pair{Sort::kMagnitudes, "magnitudes"}),
                         [](const auto& sort) { return std::string(sort.param.second); });

}  // namespace
}  // namespace terrace::tin
