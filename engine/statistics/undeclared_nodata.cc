#include "engine/statistics/undeclared_nodata.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/common/dem_types.h"
#include "engine/core/plain_number.h"
#include "engine/statistics/raster_chunk.h"

namespace terrace::dem {
namespace {

constexpr std::array<double, 6> kUsualNodata = {-32768, -32767, -9999, 9999, 32767, 65535};
constexpr double kAloneWithin = 1'000;  // metres
// The shore of the Dead Sea is at -433 m, the summit of Mount Everest at 8,849 m, the deepest sea floor at -10,935 m.
constexpr double kLowestLand = -500, kHighest = 9'000, kDeepest = -12'000;
constexpr int kReach = 3;  // samples: kernels of resampling reach 2, rounded up for oblique ones
// Voids are evidence about samples near them only if most samples are not near voids: at most one in four.
constexpr std::int64_t kDense = 4;
constexpr double kLeap = 1'000;  // metres between two samples; a nodata value is farther from the ground
// Resampling mixes values all around a void: at least one in eight of the samples within reach.
constexpr std::int64_t kMixed = 8;
constexpr int kMixedRim = 2, kCollarRim = 1;
constexpr int kChunk = 1024;  // samples along a side

// Heights beyond a bound.
struct Beyond {
  std::int64_t all = 0, alone = 0,
               leaps = 0;  // alone: no void nearby; leaps: a neighbour differs by more than the leap
};

// Counts of both passes of FindVoids.
struct Evidence {
  std::array<std::int64_t, kUsualNodata.size()> at_value{}, near_value{};
  Beyond below_land, below_sea, above;
  std::int64_t valid = 0, near_void = 0;

  bool IsDense() const { return near_void * kDense <= valid; }
  bool AreMixtures(const Beyond& beyond) const {
    return beyond.all > 0 && beyond.alone == 0 && IsDense() && beyond.leaps * 2 >= beyond.all;
  }
};

class BandScanner {
 public:
  // `leap`: metres.
  BandScanner(GDALRasterBand& band, const SampleRules& rules, double leap, const std::stop_token& stop)
      : band_(band), rules_(rules), leap_(static_cast<float>(leap)), stop_(stop) {
    for (std::size_t i = 0; i < kUsualNodata.size(); ++i)
      heights_[i] = static_cast<float>(rules.Metres(kUsualNodata[i]));
  }

  template <typename Visit>
  Result<void> ForEachChunk(const Visit& visit) {
    for (int row = 0; row < band_.GetYSize(); row += kChunk) {
      for (int col = 0; col < band_.GetXSize(); col += kChunk) {
        left_ = std::max(col - kReach, 0);
        top_ = std::max(row - kReach, 0);
        wide_ = std::min(col + kChunk + kReach, band_.GetXSize()) - left_;
        high_ = std::min(row + kChunk + kReach, band_.GetYSize()) - top_;
        samples_.resize(Area(wide_, high_));
        auto read = ReadHeights(band_, rules_, left_, top_, wide_, high_, samples_.data(), stop_);
        if (!read) return read;
        FindVoidsInRows();
        const int end_row = std::min(row + kChunk, band_.GetYSize()),
                  end_col = std::min(col + kChunk, band_.GetXSize());
        for (int r = row - top_; r < end_row - top_; ++r) {
          for (int c = col - left_; c < end_col - left_; ++c) visit(c, r);
        }
      }
    }
    return {};
  }

  float At(int c, int r) const { return samples_[Index(c, r)]; }

  // Samples of one of the values are no evidence that another one is a height, as -32767 is none for -32768.
  void CountValues(float height, Evidence& evidence) const {
    const auto same = std::ranges::find(heights_, height);
    if (same != heights_.end()) {
      ++evidence.at_value[static_cast<std::size_t>(same - heights_.begin())];
      return;
    }
    for (std::size_t i = 0; i < kUsualNodata.size(); ++i) {
      if (std::abs(height - heights_[i]) <= kAloneWithin) ++evidence.near_value[i];
    }
  }

  void CountBeyond(int c, int r, Evidence& evidence) const {
    const float height = At(c, r);
    if (std::isnan(height)) return;
    const bool is_near = IsNearVoid(c, r);
    ++evidence.valid;
    evidence.near_void += is_near;
    if (height >= kLowestLand && height <= kHighest) return;
    const bool leaps = Leaps(c, r);
    const auto count = [&](Beyond& beyond) {
      ++beyond.all;
      beyond.alone += !is_near;
      beyond.leaps += leaps;
    };
    if (height < kLowestLand) count(evidence.below_land);
    if (height < kDeepest) count(evidence.below_sea);
    if (height > kHighest) count(evidence.above);
  }

 private:
  std::size_t Index(int c, int r) const { return IndexAt(c, r, wide_); }

  void FindVoidsInRows() {
    void_in_row_.assign(samples_.size(), 0);
    for (int r = 0; r < high_; ++r) {
      const auto row = void_in_row_.begin() + static_cast<std::ptrdiff_t>(Index(0, r));
      for (int c = 0; c < wide_; ++c) {
        if (std::isnan(At(c, r))) std::fill(row + std::max(c - kReach, 0), row + std::min(c + kReach + 1, wide_), 1);
      }
    }
  }

  bool IsNearVoid(int c, int r) const {
    for (int y = std::max(r - kReach, 0); y <= std::min(r + kReach, high_ - 1); ++y) {
      if (void_in_row_[Index(c, y)] != 0) return true;
    }
    return false;
  }

  bool Leaps(int c, int r) const {
    for (int y = std::max(r - 1, 0); y <= std::min(r + 1, high_ - 1); ++y) {
      for (int x = std::max(c - 1, 0); x <= std::min(c + 1, wide_ - 1); ++x) {
        if (std::abs(At(x, y) - At(c, r)) > leap_) return true;  // not of NaN
      }
    }
    return false;
  }

  GDALRasterBand& band_;
  const SampleRules& rules_;
  const float leap_;
  const std::stop_token stop_;
  std::array<float, kUsualNodata.size()> heights_{};
  int left_ = 0, top_ = 0, wide_ = 0, high_ = 0;  // of the samples read
  std::vector<float> samples_;
  std::vector<std::uint8_t> void_in_row_;  // within reach of a sample, in its row
};

}  // namespace

void ZeroEdges::Add(const float* heights, std::ptrdiff_t stride, const Chunk& chunk, int raster_width,
                    int raster_height, double step_m) {
  const int cols = chunk.cols, rows = chunk.rows;
  const bool left = chunk.col == 0, right = chunk.col + cols == raster_width;
  const auto step = static_cast<float>(step_m);
  // Counters of int and no branches: the compiler makes vectors of these loops.
  const auto add_pairs = [&](const float* a, const float* b, int count) {
    int above = 0, others = 0;
    for (int i = 0; i < count; ++i) {
      const float other = std::abs(a[i] + b[i]);  // where the other one is zero
      const bool is_pair = (a[i] == 0) != (b[i] == 0);
      above += static_cast<int>(is_pair & (other > step));
      others += static_cast<int>(is_pair & (other <= step));  // not of NaN
    }
    steep += above;
    gentle += others;
  };
  const auto zeros_in = [&](int row) {
    int count = 0;
    for (int c = 0; row < rows && c < cols; ++c) count += static_cast<int>(heights[row * stride + c] == 0);
    return count;
  };
  int zeros_below = zeros_in(0);
  for (int r = 0; r < rows; ++r) {
    const float* const row = heights + r * stride;
    const int zeros_here = zeros_below;
    zeros_below = zeros_in(r + 1);
    if (zeros_here > 0 || zeros_below > 0) {  // else there is no pair
      add_pairs(row, row + 1, cols - 1);
      if (r + 1 < rows) add_pairs(row, row + stride, cols);
    }
    zeros += zeros_here;
    at_border += (left && row[0] == 0) + (right && row[cols - 1] == 0);
    const int raster_row = chunk.row + r;
    if (raster_row == 0 || raster_row + 1 == raster_height) at_border += zeros_here;
    if (zeros_here < cols) AddGround(row, cols, chunk.col, raster_row);
  }
}

void ZeroEdges::AddGround(const float* heights, int cols, int raster_col, int raster_row) {
  const auto is_ground = [](float height) { return height != 0 && !std::isnan(height); };
  const auto first = static_cast<std::int32_t>(std::find_if(heights, heights + cols, is_ground) - heights);
  if (first == cols) return;
  std::int32_t last = cols - 1;
  while (!is_ground(heights[last])) --last;
  west = std::min(west, raster_col + first);
  east = std::max(east, raster_col + last);
  north = std::min(north, raster_row);
  south = std::max(south, raster_row);
  for (std::int32_t c = first; c <= last && !(lowest < highest); ++c) {
    if (!is_ground(heights[c])) continue;
    lowest = std::min(lowest, heights[c]);
    highest = std::max(highest, heights[c]);
  }
}

void ZeroEdges::Add(const ZeroEdges& other) {
  steep += other.steep;
  gentle += other.gentle;
  zeros += other.zeros;
  at_border += other.at_border;
  west = std::min(west, other.west);
  east = std::max(east, other.east);
  north = std::min(north, other.north);
  south = std::max(south, other.south);
  lowest = std::min(lowest, other.lowest);
  highest = std::max(highest, other.highest);
}

bool ZeroEdges::IsCollar(int raster_width, int raster_height) const {
  constexpr std::int64_t kFewest = 16, kExceptions = 50;  // one in 50
  constexpr int kNearly = 16;                             // a sixteenth of a side
  const int margin_x = raster_width / kNearly, margin_y = raster_height / kNearly;
  const bool reaches_all_sides = west <= margin_x && east >= raster_width - 1 - margin_x && north <= margin_y &&
                                 south >= raster_height - 1 - margin_y;
  if (!reaches_all_sides || !(lowest < highest)) return false;
  const bool is_strewn = steep * 4 > zeros && at_border * 4 < zeros;
  return at_border >= kFewest && steep >= kFewest && gentle * kExceptions <= steep && !is_strewn;
}

void DetectedNodata::AddTo(SampleRules& rules) const {
  rules.extra_nodata.insert(rules.extra_nodata.end(), values.begin(), values.end());
  rules.lowest = std::max(rules.lowest, lowest);
  rules.highest = std::min(rules.highest, highest);
  rules.void_margin = std::max(rules.void_margin, void_margin);
}

bool MayHideVoids(const SampleRules& rules, double lowest, double highest, bool has_voids, bool has_collar) {
  const auto is_usual = [&](double height) {
    return std::ranges::any_of(kUsualNodata,
                               [&](double value) { return static_cast<float>(rules.Metres(value)) == height; });
  };
  return has_collar || is_usual(lowest) || is_usual(highest) || lowest < kDeepest || highest > kHighest ||
         (has_voids && lowest < kLowestLand);
}

Result<DetectedNodata> FindVoids(GDALRasterBand& band, const SampleRules& rules, bool has_collar, double coast_step_m,
                                 const std::stop_token& stop) {
  DetectedNodata detected;
  const auto say = [&detected](const std::string& what) {
    detected.text += (detected.text.empty() ? "" : ", ") + what;
  };
  const double leap = std::max(kLeap, coast_step_m);
  Evidence evidence;
  BandScanner usual(band, rules, leap, stop);
  auto read = usual.ForEachChunk([&](int c, int r) { usual.CountValues(usual.At(c, r), evidence); });
  if (!read) return tl::unexpected(read.error());
  for (std::size_t i = 0; i < kUsualNodata.size(); ++i) {
    if (evidence.at_value[i] == 0 || evidence.near_value[i] * 4 > evidence.at_value[i]) continue;
    detected.values.push_back(kUsualNodata[i]);
    say(fmt::format("{} samples of {}", evidence.at_value[i], PlainNumber(kUsualNodata[i])));
  }
  if (has_collar) {
    const double zero = (0 - rules.offset) / rules.scale, whole = std::round(zero);
    detected.values.push_back(rules.Metres(whole) == 0 ? whole : zero);  // the quotient may be inexact
    say("a collar of zeros");
  }

  // Examines the samples beside these voids and beside declared ones.
  SampleRules found = rules;
  detected.AddTo(found);
  BandScanner beyond(band, found, leap, stop);
  read = beyond.ForEachChunk([&](int c, int r) { beyond.CountBeyond(c, r, evidence); });
  if (!read) return tl::unexpected(read.error());
  if (has_collar && evidence.IsDense()) detected.void_margin = kCollarRim;
  const auto mixed = [&](const Beyond& beyond_it, double bound) {
    if (!evidence.AreMixtures(beyond_it)) return false;
    say(fmt::format("{} samples {} {} m at their edges", beyond_it.all, bound < 0 ? "below" : "above",
                    PlainNumber(bound)));
    if (beyond_it.all * kMixed >= evidence.near_void) detected.void_margin = kMixedRim;
    return true;
  };
  if (mixed(evidence.below_land, kLowestLand)) {
    detected.lowest = kLowestLand;
  } else if (mixed(evidence.below_sea, kDeepest)) {
    detected.lowest = kDeepest;
  }
  if (mixed(evidence.above, kHighest)) detected.highest = kHighest;
  return detected;
}

}  // namespace terrace::dem
