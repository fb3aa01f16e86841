// Nodes are located and read by rows, in vectors. The results must be equal to those of each node on its own, on every
// set of instructions.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "engine/raster/grid_cells.h"
#include "engine/raster/nan_heights.h"
#include "engine/raster/node_rows.h"
#include "tests/engine/tin/instruction_sets.h"

namespace terrace::dem {
namespace {

// A raster, a window of nodes over it, and the requested nodes.
class Case {
 public:
  explicit Case(unsigned seed) : random_(seed) {
    factor_ = 1 << Pick(4);
    wraps_ = Pick(3) == 0;
    width_ = wraps_ ? 64 * (1 + Pick(4)) : 5 + Pick(200);
    height_ = 5 + Pick(200);
    nodes_ = {0, 0, 2 + Pick(40), 2 + Pick(40)};
    const bool is_wide = wraps_ && Pick(3) == 0;  // half of the Earth, like a tile of level 0 with its halo
    const double step = is_wide ? width_ / 2.0 / nodes_.columns : (0.2 + Pick(30) * 0.1) * factor_;
    // In half of the cases another raster grid has filled some columns.
    const int hidden = Pick(nodes_.columns), hidden_end = Pick(2) == 0 ? hidden : hidden + Pick(nodes_.columns);
    const double west = Pick(width_ + 40) - 20, north = Pick(height_ + 40) - 20;
    for (int i = 0; i < nodes_.columns; ++i) x_.push_back(Placed(west + i * step));
    for (int j = 0; j < nodes_.rows; ++j) y_.push_back(north + (nodes_.rows - 1 - j) * step);
    for (const double y : y_) {
      for (int i = 0; i < nodes_.columns; ++i) {
        const double x = x_[static_cast<std::size_t>(i)];
        const bool is_inside = y >= 0 && y <= height_ && (wraps_ || (x >= 0 && x <= width_));
        const bool is_hidden = i >= hidden && i < hidden_end;
        wanted_.push_back(is_inside && !is_hidden && Pick(20) != 0 ? 1 : 0);
      }
    }
  }

  GridAxes axes() const { return {{width_, factor_, wraps_}, {height_, factor_, false}, width_, height_}; }
  NodePositions ByAxes() const { return {nodes_, x_, y_}; }
  NodePositions ByNodes() const {
    std::vector<Position> nodes;
    for (const double y : y_) {
      for (const double x : x_) nodes.push_back({x, y});
    }
    const PositionExtent extent = ExtentOf(nodes);
    return {nodes_, std::move(nodes), extent};
  }
  const std::vector<std::uint8_t>& wanted() const { return wanted_; }
  bool is_any_wanted() const { return std::ranges::count(wanted_, std::uint8_t{1}) > 0; }
  const NodeWindow& nodes() const { return nodes_; }

  // Heights that use all bits of a float; one in twelve is void.
  std::vector<float> Samples(const GridWindow& window) {
    std::vector<float> samples(static_cast<std::size_t>(window.columns * window.rows));
    std::uniform_real_distribution<float> height(-500, 9000);
    for (float& sample : samples) sample = Pick(12) == 0 ? std::numeric_limits<float>::quiet_NaN() : height(random_);
    return samples;
  }

 private:
  int Pick(int count) { return static_cast<int>(random_() % static_cast<unsigned>(count)); }
  // Like Georeference::ToPixels: columns are inside the raster if it wraps.
  double Placed(double x) const { return wraps_ ? x - std::floor(x / width_) * width_ : x; }

  std::mt19937 random_;
  int factor_ = 1, width_ = 0, height_ = 0;
  bool wraps_ = false;
  NodeWindow nodes_;
  std::vector<double> x_, y_;
  std::vector<std::uint8_t> wanted_;
};

// The cells of requested nodes are in the window, as far as their samples count.
void ExpectInside(const NodeCells& cells, const GridWindow& window, const Case& one) {
  const auto columns = static_cast<std::size_t>(one.nodes().columns);
  for (std::size_t n = 0; n < one.wanted().size(); ++n) {
    if (one.wanted()[n] == 0) continue;
    const GridCell cell = cells.At(n % columns, n / columns);
    ASSERT_GE(cell.column, window.column);
    ASSERT_LT(cell.column + (cell.x > 0 ? 1 : 0), window.column + window.columns);
    ASSERT_GE(cell.row, window.row);
    ASSERT_LT(cell.row + (cell.y > 0 ? 1 : 0), window.row + window.rows);
  }
}

TEST(NodeCells, OfAxesAreThoseOfSingleNodes) {
  int tried = 0, around = 0;
  for (unsigned seed = 0; seed < 4000; ++seed) {
    SCOPED_TRACE(seed);
    const Case one(seed);
    if (!one.is_any_wanted()) continue;
    ++tried;
    NodeCells by_axes(one.ByAxes(), one.axes()), by_nodes(one.ByNodes(), one.axes());
    ASSERT_TRUE(by_axes.is_separable());
    ASSERT_FALSE(by_nodes.is_separable());
    const GridWindow window = by_axes.MoveIntoWindow(one.wanted());
    const GridWindow of_nodes = by_nodes.MoveIntoWindow(one.wanted());
    ASSERT_NO_FATAL_FAILURE(ExpectInside(by_axes, window, one));
    ASSERT_NO_FATAL_FAILURE(ExpectInside(by_nodes, of_nodes, one));
    const GridAxis axis = one.axes().columns;
    if (!axis.wraps()) {
      ASSERT_EQ(std::tuple(window.column, window.row, window.columns, window.rows),
                std::tuple(of_nodes.column, of_nodes.row, of_nodes.columns, of_nodes.rows));
    }
    around += window.column < 0 || window.column + window.columns > axis.count() ? 1 : 0;
    const auto columns = static_cast<std::size_t>(one.nodes().columns);
    for (std::size_t n = 0; n < one.wanted().size(); ++n) {
      if (one.wanted()[n] == 0) continue;
      const GridCell a = by_axes.At(n % columns, n / columns), b = by_nodes.At(n % columns, n / columns);
      ASSERT_EQ(std::tuple(a.row, a.x, a.y), std::tuple(b.row, b.x, b.y));
      ASSERT_EQ((a.column - b.column) % (axis.wraps() ? axis.count() : 1 << 20), 0);
    }
  }
  EXPECT_GT(tried, 1500);
  EXPECT_GT(around, 100);
}

struct Compared {
  int heights = 0, voids = 0, left = 0;
};

// Rows of nodes against Interpolate at each of them.
void ExpectRows(Case one, NodePositions positions, Compared& compared) {
  NodeCells cells(std::move(positions), one.axes());
  const GridWindow window = cells.MoveIntoWindow(one.wanted());
  const std::vector<float> samples = one.Samples(window);
  const auto columns = static_cast<std::size_t>(one.nodes().columns);
  std::size_t first = columns, end = 0;
  for (std::size_t n = 0; n < one.wanted().size(); ++n) {
    if (one.wanted()[n] != 0) first = std::min(first, n % columns), end = std::max(end, n % columns + 1);
  }
  NodeRows rows(samples, window, cells, first, end);
  for (std::size_t j = 0; j < static_cast<std::size_t>(one.nodes().rows); ++j) {
    const auto row = std::span(one.wanted()).subspan(j * columns, columns);
    if (std::ranges::count(row, std::uint8_t{1}) == 0) continue;
    const std::span<const double> heights = rows.Row(j);
    ASSERT_EQ(heights.size(), end - first);
    for (std::size_t i = first; i < end; ++i) {
      if (row[i] == 0) continue;
      const GridCell cell = cells.At(i, j);
      const auto expected = Interpolate(samples, window, cell);
      const double height = heights[i - first];
      if (!std::isnan(height)) {
        ASSERT_TRUE(expected);
        ASSERT_EQ(std::bit_cast<std::uint64_t>(height), std::bit_cast<std::uint64_t>(*expected));
        ++compared.heights;
      } else if (HasSample(samples, window, cell)) {  // what its other samples give is for Interpolate
        ++compared.left;
      } else {
        ++compared.voids;
      }
    }
  }
}

TEST(NodeRows, AreBitForBitWhatEachNodeGives) {
  tin::ForEachInstructionSet([] {
    Compared by_axes, by_nodes;
    for (unsigned seed = 0; seed < 2000; ++seed) {
      SCOPED_TRACE(seed);
      const Case one(seed);
      if (!one.is_any_wanted()) continue;
      ASSERT_NO_FATAL_FAILURE(ExpectRows(one, one.ByAxes(), by_axes));
      ASSERT_NO_FATAL_FAILURE(ExpectRows(one, one.ByNodes(), by_nodes));
    }
    EXPECT_GT(by_axes.heights, 50'000);
    EXPECT_GT(by_axes.left, 5'000);
    EXPECT_GT(by_nodes.heights, by_axes.heights / 3) << "only ends of axes and columns that wrap are left";
  });
}

TEST(NodeRows, RoundsAsSingleHeights) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> metres(-12'000, 9'000), small(-0x1p-9, 0x1p-9);
  std::vector<double> heights = {0, -0.0, 0x1p-11, -0x1p-11, 0x1.8p-10, -0x1.8p-10, 0x1p41, -0x1p41}, added;
  for (int i = 0; i < 999; ++i) heights.push_back(i % 3 == 0 ? small(random) : metres(random));
  for (std::size_t i = 0; i < heights.size(); ++i) added.push_back(i % 5 == 0 ? 0 : small(random));
  heights[100] = std::numeric_limits<double>::quiet_NaN();
  tin::ForEachInstructionSet([&] {
    for (const std::size_t count : {std::size_t{1}, std::size_t{7}, heights.size()}) {
      for (const bool adds : {false, true}) {
        std::vector<float> rounded(count);
        RoundHeights(std::span(heights).first(count), adds ? std::span(added).first(count) : std::span<double>(),
                     rounded);
        for (std::size_t i = 0; i < count; ++i) {
          const float expected = RoundHeight(adds ? heights[i] + added[i] : heights[i]);
          if (std::isnan(expected)) {
            EXPECT_TRUE(std::isnan(rounded[i]));
          } else {
            EXPECT_EQ(std::bit_cast<std::uint32_t>(rounded[i]), std::bit_cast<std::uint32_t>(expected)) << heights[i];
          }
        }
        EXPECT_EQ(HasVoids(rounded), count > 100);
      }
    }
  });
}

TEST(NodeRows, VoidsAreCountedReplacedAndWantedWhereNodesAreInside) {
  std::mt19937 random(7);
  tin::ForEachInstructionSet([&] {
    for (std::size_t count = 0; count < 70; ++count) {
      const auto voids = static_cast<unsigned>(1 + count % 9);  // one of so many
      std::vector<float> heights(count);
      std::vector<std::uint8_t> inside(count), wanted(count, 7), expected(count);
      std::size_t counted = 0;
      for (std::size_t i = 0; i < count; ++i) {
        const bool is_void = random() % voids == 0;
        heights[i] = is_void ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(random() % 100);
        inside[i] = random() % 3 != 0 ? 1 : 0;
        counted += is_void ? 1 : 0;
        expected[i] = is_void && inside[i] != 0 ? 1 : 0;
      }
      EXPECT_EQ(CountVoids(heights), counted);
      EXPECT_EQ(WantVoids(inside, heights, wanted), std::ranges::count(expected, std::uint8_t{1}) > 0) << count;
      EXPECT_EQ(wanted, expected);
      std::vector<float> replaced = heights;
      ReplaceVoids(replaced, -12.5f);
      for (std::size_t i = 0; i < count; ++i) {
        EXPECT_EQ(replaced[i], std::isnan(heights[i]) ? -12.5f : heights[i]) << count;
      }
    }
  });
}

// Between four samples the surface is bilinear. Beside voids it is the weighted mean of the valid samples.
TEST(Interpolate, IsBilinearAndLeavesVoidsOut) {
  const GridWindow window{10, 20, 2, 2};
  const float none = std::numeric_limits<float>::quiet_NaN();
  EXPECT_EQ(Interpolate({0, 8, 16, 24}, window, {10, 20, 0.25, 0.5}), 10);
  EXPECT_EQ(Interpolate({0, 8, 16, none}, window, {10, 20, 0.5, 0.5}), 8);
  EXPECT_EQ(Interpolate({none, none, none, 3}, window, {10, 20, 0.25, 0.5}), 3);
  EXPECT_EQ(Interpolate({none, none, none, none}, window, {10, 20, 0.25, 0.5}), std::nullopt);
  EXPECT_EQ(Interpolate({7, none, none, none}, window, {10, 20, 0, 0}), 7) << "samples without a weight may be void";
}

}  // namespace
}  // namespace terrace::dem
