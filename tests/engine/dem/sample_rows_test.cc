// Compares statistics of rows of samples, which are computed in vectors, with those of one sample after the other.
#include "engine/statistics/sample_rows.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "engine/gdal/sample_rules.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::dem {
namespace {

std::vector<float> RandomSamples(std::size_t count, unsigned voids_in_8, std::mt19937& random) {
  std::uniform_real_distribution<float> height(-400, 8800);
  std::vector<float> samples(count);
  for (float& sample : samples) sample = random() % 8 < voids_in_8 ? SampleRules::kVoid : height(random);
  return samples;
}

TEST(SampleRows, RangeIsThatOfTheSingleSamples) {
  std::mt19937 random(5);
  for (const unsigned voids : {0U, 1U, 8U}) {
    for (std::size_t count = 0; count <= 70; ++count) {
      const std::vector<float> samples = RandomSamples(count, voids, random);
      BlockRange range, expected;
      if (count % 2 == 0) {
        range.Add(2'000), expected.Add(2'000);
      }
      std::int64_t valid = 0;
      for (const float sample : samples) {
        expected.Add(sample);
        valid += std::isnan(sample) ? 0 : 1;
      }
      tin::ForEachInstructionSet([&] {
        BlockRange added = range;
        EXPECT_EQ(AddToRange(samples, added), valid) << count;
        EXPECT_EQ(added.min, expected.min) << count;
        EXPECT_EQ(added.max, expected.max) << count;
        EXPECT_EQ(added.has_voids, expected.has_voids) << count;
      });
    }
  }
}

TEST(SampleRows, LargestDistanceIsThatOfTheSingleSamples) {
  std::mt19937 random(6);
  std::uniform_real_distribution<double> height(-400, 8800);
  for (const std::size_t length : {2UL, 4UL, 8UL, 16UL, 64UL}) {
    for (const std::size_t runs : {0UL, 1UL, 3UL, 8UL, 13UL, 32UL}) {
      for (const unsigned voids : {0U, 2U, 8U}) {
        const std::vector<float> samples = RandomSamples(length * runs, voids, random);
        std::vector<double> averages(runs + 1), weights(length);
        for (double& average : averages) average = height(random);
        for (std::size_t k = 0; k < length; ++k)
          weights[k] = (static_cast<double>(k) + 0.5) / static_cast<double>(length);
        double expected = 0;
        for (std::size_t i = 0; i < samples.size(); ++i) {
          const double from = averages[i / length], to = averages[i / length + 1];
          const double distance = std::abs(from + weights[i % length] * (to - from) - double{samples[i]});
          if (distance > expected) expected = distance;
        }
        tin::ForEachInstructionSet([&] {
          EXPECT_EQ(LargestDistance({samples.data(), averages.data(), runs, weights}), expected)
              << length << ' ' << runs;
        });
      }
    }
  }
}

}  // namespace
}  // namespace terrace::dem
