// Compares the one-pass search for voids that touch the rim with a flood fill.
#include "engine/statistics/rim_voids.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <functional>
#include <limits>
#include <random>
#include <utility>
#include <vector>

namespace terrace::dem {
namespace {

// Chunks of a raster as the statistics pass makes them.
RimVoids FindRimVoids(int width, int height, const std::vector<std::uint8_t>& voids, std::size_t max_runs,
                      std::vector<std::uint8_t>& holes) {
  holes.assign(voids.size(), 0);
  const auto at = [&](int c, int r) {
    return static_cast<std::size_t>(r) * static_cast<std::size_t>(width) + static_cast<std::size_t>(c);
  };
  RimVoidFinder finder(
      width, height,
      [&](int row, int first, int last, std::int64_t) {
        std::fill(&holes[at(first, row)], &holes[at(last, row)] + 1, 1);
      },
      max_runs);
  const ChunkGrid chunks(width, height);
  for (int index = 0; index < chunks.count(); ++index) {
    const Chunk chunk = chunks.At(index);
    ChunkStatistics part;
    for (int r = 0; r < chunk.rows; ++r) {
      for (int c = 0; c < chunk.cols; ++c) {
        if (voids[at(chunk.col + c, chunk.row + r)] == 0) {
          ++part.valid;
        } else if (!part.voids.empty() && part.voids.back().row == r && part.voids.back().last + 1 == c) {
          ++part.voids.back().last;
        } else {
          const auto column = static_cast<std::uint16_t>(c);
          part.voids.push_back({static_cast<std::uint16_t>(r), column, column});
        }
      }
    }
    if (part.is_void()) part.voids.clear();
    finder.Add(chunk, part);
  }
  return finder.Finish();
}

TEST(RimVoids, AreThoseThatAFloodFromTheRimFinds) {
  constexpr int kWidth = 1100, kHeight = 1090;
  std::mt19937 random(5);
  for (const int percent : {3, 55, 59, 62, 100}) {
    SCOPED_TRACE(percent);
    std::vector<std::uint8_t> voids(std::size_t{kWidth} * kHeight);
    for (std::uint8_t& v : voids) v = static_cast<int>(random() % 100) < percent ? 1 : 0;
    std::vector<std::uint8_t> reached(voids.size()), holes;
    std::vector<std::pair<int, int>> queue;
    const auto reach = [&](int c, int r) {
      if (c < 0 || r < 0 || c >= kWidth || r >= kHeight) return;
      const std::size_t at = static_cast<std::size_t>(r) * kWidth + static_cast<std::size_t>(c);
      if (voids[at] == 0 || reached[at] != 0) return;
      reached[at] = 1;
      queue.emplace_back(c, r);
    };
    for (int c = 0; c < kWidth; ++c) reach(c, 0), reach(c, kHeight - 1);
    for (int r = 0; r < kHeight; ++r) reach(0, r), reach(kWidth - 1, r);
    for (std::size_t i = 0; i < queue.size(); ++i) {
      const auto [c, r] = queue[i];
      reach(c - 1, r), reach(c + 1, r), reach(c, r - 1), reach(c, r + 1);
    }
    const RimVoids rim = FindRimVoids(kWidth, kHeight, voids, RimVoidFinder::kMaxRuns, holes);
    const std::vector<RimVoids::Run> runs = rim.Runs();
    EXPECT_EQ(RimVoids(runs, rim.regions()).Runs(), runs);
    int wrong_rims = 0, wrong_holes = 0;
    for (int r = 0; r < kHeight; ++r) {
      for (int c = 0; c < kWidth; ++c) {
        const std::size_t at = static_cast<std::size_t>(r) * kWidth + static_cast<std::size_t>(c);
        wrong_rims += rim.At(c, r).has_value() != (reached[at] != 0);
        wrong_holes += (holes[at] != 0) != (voids[at] != 0 && reached[at] == 0);
      }
    }
    EXPECT_EQ(wrong_rims, 0);
    EXPECT_EQ(wrong_holes, 0);
    if (percent == 100) {
      EXPECT_EQ(rim.regions(), 1u);
    }
  }
}

TEST(RimVoids, SayHowFarTheyStayTheSame) {
  std::mt19937 random(9);
  std::vector<RimVoids::Run> runs;
  for (std::int32_t row = 3; row < 60; ++row) {
    const bool is_like_the_row_above = row > 3 && random() % 4 != 0;
    for (std::size_t i = 0, count = runs.size(); is_like_the_row_above && i < count; ++i) {
      if (runs[i].row == row - 1) runs.push_back({row, runs[i].first, runs[i].last, runs[i].region});
    }
    for (std::int32_t column = 0; !is_like_the_row_above && column < 50;) {
      const auto length = static_cast<std::int32_t>(random() % 9);
      if (random() % 2 == 0) runs.push_back({row, column, column + length, static_cast<std::uint32_t>(random() % 3)});
      column += length + 2;
    }
  }
  const RimVoids voids(runs, 3);
  ASSERT_EQ(voids.Runs(), runs);
  const auto brute = [&](std::int64_t column, std::int64_t row) -> std::optional<std::uint32_t> {
    for (const RimVoids::Run& run : runs) {
      if (run.row == row && run.first <= column && column <= run.last) return run.region;
    }
    return std::nullopt;
  };
  for (std::int64_t row = 0; row < 64; ++row) {
    for (std::int64_t column = 0; column < 64; ++column) {
      const RimVoids::Stretch found = voids.StretchAt(column, row);
      ASSERT_EQ(found.region, brute(column, row)) << column << ' ' << row;
      ASSERT_GE(found.last_column, column);
      ASSERT_GE(found.last_row, row);
      for (auto x = column; x <= std::min<std::int64_t>(found.last_column, 70); ++x)
        ASSERT_EQ(brute(x, row), found.region);
      for (auto y = row; y <= std::min<std::int64_t>(found.last_row, 70); ++y)
        ASSERT_EQ(brute(column, y), found.region);
    }
  }
}

// For tens of thousands of sparse rasters a run for each row would take gigabytes.
TEST(RimVoids, TakeMemoryForRowsThatDiffer) {
  std::vector<std::uint8_t> voids(3600 * 3600, 1), holes;
  for (std::size_t row = 2000; row < 2128; ++row) std::fill_n(&voids[row * 3600 + 1000], 128, 0);
  const RimVoids rim = FindRimVoids(3600, 3600, voids, RimVoidFinder::kMaxRuns, holes);
  EXPECT_EQ(rim.Runs().size(), 3600u + 128u);
  EXPECT_LT(rim.bytes(), 200u);
  EXPECT_TRUE(rim.At(999, 2100) && rim.At(1128, 2100) && rim.At(1000, 1999) && rim.At(1000, 2128));
  EXPECT_FALSE(rim.At(1000, 2100));
}

TEST(RimVoids, AreAllWhereTheyAreTooRagged) {
  std::vector<std::uint8_t> voids(600 * 1500), holes;
  for (std::size_t i = 0; i < voids.size(); i += 2) voids[i] = 1;
  EXPECT_FALSE(FindRimVoids(600, 1500, voids, 600 * 1500, holes).is_everything());
  const RimVoids rim = FindRimVoids(600, 1500, voids, 1000, holes);
  EXPECT_TRUE(rim.is_everything());
  EXPECT_TRUE(rim.At(300, 700).has_value());
}

}  // namespace
}  // namespace terrace::dem
