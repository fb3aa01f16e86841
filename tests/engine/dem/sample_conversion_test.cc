// Compares heights of samples and their averages with the rule for a single sample. The loops of the product use other
// types, several samples at once and no branches, and must give the same bits.
#include <gdal_priv.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "engine/gdal/sample_rules.h"
#include "engine/raster/block_averages.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::dem {
namespace {

constexpr int kSide = 97;

bool IsSameHeight(float a, float b) {
  return (std::isnan(a) && std::isnan(b)) || std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

// Values at the ends of a type and of Earth's heights, zeros of both signs, and ordinary ones.
double RawValue(std::mt19937& random, bool is_float) {
  static const std::vector<double> kSpecial = {0,    7,     12,     100,     -0.0,   -32768,       32767,     65535,
                                               255,  -9999, 99998,  99999,   -99998, -99999,       12345.678, 0.1F,
                                               1e30, 127,   128.25, 1.7e38F, 3.4e38, std::nan(""), -1e-40};
  const auto pick = random() % 4;
  if (pick == 0) return kSpecial[random() % kSpecial.size()];
  const double value = static_cast<double>(random() % 9000) - 500;
  return is_float && pick == 1 ? value + 0.3 : value;
}

TEST(SampleConversion, OfAnyTypeIsThatOfTheSingleSample) {
  std::mt19937 random(7);
  const TempDir dir;
  struct Case {
    std::string type;
    std::optional<double> nodata;
    double scale = 1, offset = 0;
    std::string unit = {};
  };
  // Nodata values that the type cannot represent are equal to no sample.
  const std::vector<Case> cases = {{"Byte", 255.0},         {"Byte", 7.0000000001},     {"Int16", -9999.0},
                                   {"Int16", std::nullopt}, {"Int16", -9999.5},         {"Int16", 1e9},
                                   {"UInt16", 65535.0},     {"UInt16", 12.0, 0.25, -3}, {"Int16", 5.0, 1, 0, "ft"},
                                   {"Float32", 0.1},        {"Float32", std::nan("")},  {"Float32", 12345.678},
                                   {"Float32", -0.0},       {"Float32", 1e30},          {"Float64", 0.1},
                                   {"Int32", -99999.0}};
  int index = 0;
  for (const Case& c : cases) {
    SCOPED_TRACE(testing::Message() << index << ' ' << c.type);
    RasterSpec spec{.width = kSide,
                    .height = kSide,
                    .type = c.type,
                    .nodata = c.nodata,
                    .unit = c.unit,
                    .scale = c.scale,
                    .offset = c.offset};
    spec.value = [&](int, int) { return RawValue(random, c.type == "Float32" || c.type == "Float64"); };
    const std::string path = WriteRaster(dir, spec, std::to_string(index++) + ".tif");
    const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str()));
    ASSERT_NE(dataset, nullptr);
    GDALRasterBand& band = *dataset->GetRasterBand(1);
    for (const auto& [lowest, highest] :
         {std::pair(-kMaxAbsHeight, kMaxAbsHeight), std::pair(12.0000000001, 99.9999999999)}) {
      SampleRules rules = SampleRules::Of(band, "");
      rules.lowest = lowest, rules.highest = highest;
      std::vector<double> raw(kSide * kSide);
      std::vector<float> heights(raw.size());
      ASSERT_EQ(band.RasterIO(GF_Read, 0, 0, kSide, kSide, raw.data(), kSide, kSide, GDT_Float64, 0, 0, nullptr),
                CE_None);
      int voids = 0;
      tin::ForEachInstructionSet([&] {
        ASSERT_TRUE(ReadHeights(band, rules, 0, 0, kSide, kSide, heights.data(), {}));
        voids = 0;
        for (std::size_t i = 0; i < raw.size(); ++i) {
          ASSERT_TRUE(IsSameHeight(heights[i], rules.ToHeight(raw[i]))) << raw[i] << ": " << heights[i];
          voids += std::isnan(heights[i]) ? 1 : 0;
        }
      });
      EXPECT_LT(voids, kSide * kSide);
      if (lowest > 0) {
        EXPECT_GT(voids, 0);
      }
    }
  }
}

// Sums are in the order of the samples: row by row within a block.
TEST(BlockAverages, AreSumsOfTheSamplesOfABlockInTheirOrder) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> height(-400, 8800);
  for (const int block : {1, 2, 3, 4, 5, 8, 16, 64}) {
    for (const int columns : {1, 2, 7, 20, 64, 97, 98}) {
      const int rows = 2 * block;
      std::vector<float> samples(static_cast<std::size_t>(columns * rows));
      for (float& sample : samples) sample = random() % 3 == 0 ? SampleRules::kVoid : height(random);
      const int blocks = (columns + block - 1) / block;
      const double weight = 0.75, last = columns % 2 == 0 ? 1 : 0.5;
      BlockAverages averages(blocks, block);
      std::vector<float> taken(static_cast<std::size_t>(blocks));
      for (int top = 0; top < rows; top += block) {
        for (int r = top; r < top + block; ++r) {
          averages.AddRow(samples.data() + r * columns, columns, weight, last);
        }
        averages.Take(taken.data());
        for (int b = 0; b < blocks; ++b) {
          double sum = 0, weights = 0;
          for (int r = top; r < top + block; ++r) {
            for (int c = b * block; c < std::min((b + 1) * block, columns); ++c) {
              const float sample = samples[static_cast<std::size_t>(r * columns + c)];
              if (std::isnan(sample)) continue;
              const double times = c + 1 == columns ? weight * last : weight;
              sum += times * sample, weights += times;
            }
          }
          const float mean = weights > 0 ? static_cast<float>(sum / weights) : SampleRules::kVoid;
          ASSERT_TRUE(IsSameHeight(taken[static_cast<std::size_t>(b)], mean)) << block << ' ' << columns << ' ' << b;
        }
      }
    }
  }
}

// Heights of very different sizes: the sum of a block depends on the order of its samples.
TEST(BlockSums, AreInTheOrderOfTheSamples) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> height(-400, 8800);
  for (const int block : {1, 2, 3, 4, 8, 12, 64}) {
    for (const std::size_t blocks : {0UL, 1UL, 4UL, 7UL, 19UL}) {
      std::vector<float> samples(blocks * static_cast<std::size_t>(block));
      for (float& sample : samples) {
        sample = random() % 3 == 0 ? SampleRules::kVoid : std::ldexp(height(random), -static_cast<int>(random() % 50));
      }
      std::vector<BlockSum> expected(blocks, BlockSum{0.1, 2});
      for (std::size_t i = 0; i < samples.size(); ++i) {
        expected[i / static_cast<std::size_t>(block)].Add(samples[i], 0.75);
      }
      tin::ForEachInstructionSet([&] {
        std::vector<BlockSum> sums(blocks, BlockSum{0.1, 2});
        AddRowOfBlocks(samples.data(), block, 0.75, sums);
        for (std::size_t i = 0; i < blocks; ++i) {
          EXPECT_EQ(sums[i].sum, expected[i].sum) << block << ' ' << blocks << ' ' << i;
          EXPECT_EQ(sums[i].weight, expected[i].weight) << block << ' ' << blocks << ' ' << i;
        }
      });
    }
  }
}

TEST(BlockSums, MeansAreThoseOfTheSingleBlocks) {
  for (std::size_t blocks = 0; blocks <= 20; ++blocks) {
    std::vector<BlockSum> sums(blocks);
    for (std::size_t i = 0; i < blocks; ++i) {
      if (i % 3 != 0) sums[i] = {0.1 * static_cast<double>(i), static_cast<double>(i % 7 + 1) / 3};
    }
    tin::ForEachInstructionSet([&] {
      std::vector<BlockSum> taken = sums;
      std::vector<float> means(blocks);
      TakeMeans(taken, means.data());
      for (std::size_t i = 0; i < blocks; ++i) {
        EXPECT_TRUE(IsSameHeight(means[i], sums[i].Mean())) << blocks << ' ' << i;
        EXPECT_EQ(taken[i].weight, 0);
        EXPECT_EQ(taken[i].sum, 0);
      }
    });
  }
}

}  // namespace
}  // namespace terrace::dem
