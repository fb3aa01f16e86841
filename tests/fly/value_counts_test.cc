#include "fly/flight/value_counts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace terrace::fly {
namespace {

TEST(ValueCounts, HavePercentilesOfSortedValues) {
  std::mt19937 random(7);
  std::lognormal_distribution<double> some(-4, 2);
  for (const std::size_t count : {1, 2, 3, 100, 10'000}) {
    ValueCounts counts;
    std::vector<double> values;
    for (std::size_t i = 0; i < count; ++i) {
      values.push_back(i % 7 == 3 ? 0.25 : some(random));
      counts.Add(values.back());
    }
    std::ranges::sort(values);
    EXPECT_EQ(counts.size(), count);
    for (const double share : {0.0, 0.01, 0.5, 0.9, 0.99, 1.0}) {
      const double exact = values[static_cast<std::size_t>(std::ceil(share * static_cast<double>(count - 1)))];
      EXPECT_NEAR(counts.Percentile(share), exact, exact / 2048) << count << " " << share;
    }
    EXPECT_EQ(counts.Percentile(1), static_cast<float>(values.back()));
    const auto below = [&](double limit) {
      return static_cast<std::uint64_t>(std::ranges::upper_bound(values, limit) - values.begin());
    };
    for (const double limit : {0.001, 0.25, 1.0, 1e9}) {
      EXPECT_GE(counts.CountUpTo(limit), below(limit * (1 - 0x1p-11)));
      EXPECT_LE(counts.CountUpTo(limit), below(limit * (1 + 0x1p-11)));
    }
  }
}

TEST(ValueCounts, TakeThoseOfOthersAboveALimit) {
  ValueCounts some, others;
  for (const double value : {1, 2, 3}) some.Add(value);
  others.AddAbove(0, some);
  EXPECT_EQ(others.size(), 3U);
  others.AddAbove(2, some);
  EXPECT_EQ(others.size(), 4U);
  EXPECT_EQ(others.CountUpTo(2), 2U);
  others.AddAbove(3, some);
  EXPECT_EQ(others.size(), 4U);
  others.Add(std::numeric_limits<double>::infinity(), 2);
  EXPECT_EQ(others.size(), 6U);
  EXPECT_EQ(others.Percentile(0.6), 3);
  EXPECT_TRUE(std::isinf(others.Percentile(1)));
}

TEST(ValueCounts, AreNothingWithoutValues) {
  EXPECT_EQ(ValueCounts().Percentile(0.5), 0);
  EXPECT_EQ(ValueCounts().CountUpTo(1), 0u);
}

}  // namespace
}  // namespace terrace::fly
