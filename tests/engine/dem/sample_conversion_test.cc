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

// Rows of samples of very different sizes, so that a sum depends on the order of its samples.
struct SampleRows {
  std::size_t columns, rows;
  double weight, last;
  std::vector<float> samples;

  // A block of side x side samples: four samples row by row, or four blocks row by row.
  BlockSum Sum(std::size_t column, std::size_t row, std::size_t side) const {
    BlockSum sum;
    for (const std::size_t r : {row, row + side / 2}) {
      for (const std::size_t c : {column, column + side / 2}) {
        if (r >= rows || c >= columns) continue;
        if (side > 2) {
          const BlockSum quarter = Sum(c, r, side / 2);
          sum.sum += quarter.sum, sum.weight += quarter.weight;
        } else if (const float sample = samples[r * columns + c]; !std::isnan(sample)) {
          const double times = c + 1 == columns ? weight * last : weight;
          sum.sum += times * sample, sum.weight += times;
        }
      }
    }
    return sum;
  }
};

TEST(BlockSums, AreSumsOfQuartersDownToSamples) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> height(-400, 8800);
  for (const std::size_t block : {2, 4, 8, 64}) {
    for (const std::size_t columns : {1, 2, 7, 20, 64, 97, 98}) {
      SampleRows of{columns, 2 * block - 1, 0.75, columns % 2 == 0 ? 1 : 0.5, {}};
      of.samples.resize(columns * of.rows);
      for (float& sample : of.samples) {
        sample = random() % 3 == 0 ? SampleRules::kVoid : std::ldexp(height(random), -static_cast<int>(random() % 50));
      }
      tin::ForEachInstructionSet([&] {
        std::size_t checked = 0;
        const auto check = [&](int side_of, std::int64_t row, std::span<const BlockSum> sums) {
          const auto side = static_cast<std::size_t>(side_of);
          EXPECT_EQ(sums.size(), (columns + side - 1) / side) << "no sums beyond the row";
          for (std::size_t c = 0; c * side < columns; ++c, ++checked) {
            const BlockSum expected = of.Sum(c * side, static_cast<std::size_t>(row) * side, side);
            EXPECT_EQ(sums[c].sum, expected.sum) << side << ' ' << row << ' ' << c;
            EXPECT_EQ(sums[c].weight, expected.weight) << side << ' ' << row << ' ' << c;
          }
        };
        // The larger half of the sizes is summed from the sums of the smaller half.
        const std::size_t inner = block > 8 ? 8 : block;
        BlockSums large(static_cast<std::int64_t>((columns + inner - 1) / inner), static_cast<int>(block / inner));
        const auto check_large = [&](int side, std::int64_t row, std::span<const BlockSum> sums) {
          check(side * static_cast<int>(inner), row, sums);
        };
        BlockSums small(static_cast<std::int64_t>(columns), static_cast<int>(inner));
        const auto check_small = [&](int side, std::int64_t row, std::span<const BlockSum> sums) {
          check(side, row, sums);
          if (side == static_cast<int>(inner) && block > inner) large.AddRow(sums, check_large);
        };
        for (std::size_t r = 0; r < of.rows; ++r) {
          small.AddRow(&of.samples[r * columns], static_cast<std::int64_t>(columns), of.weight, of.last, check_small);
        }
        small.Finish(check_small);
        large.Finish(check_large);
        std::size_t expected = 0;
        for (std::size_t side = 2; side <= block; side *= 2) {
          expected += ((columns + side - 1) / side) * ((of.rows + side - 1) / side);
        }
        EXPECT_EQ(checked, expected);
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
      std::vector<float> means(blocks);
      WriteMeans(sums, means.data());
      for (std::size_t i = 0; i < blocks; ++i) {
        EXPECT_TRUE(IsSameHeight(means[i], sums[i].Mean())) << blocks << ' ' << i;
      }
    });
  }
}

}  // namespace
}  // namespace terrace::dem
