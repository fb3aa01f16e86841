#include "engine/statistics/rim_voids.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <tuple>
#include <utility>

namespace terrace::dem {
namespace {

constexpr std::uint32_t kNoRegion = std::numeric_limits<std::uint32_t>::max();
// If there are more regions, those that were joined to others are removed.
constexpr std::size_t kManyRegions = std::size_t{1} << 20;

}  // namespace

RimVoids::RimVoids(std::span<const Run> runs, std::uint32_t regions) : regions_(regions) {
  std::int32_t next_row = 0;
  for (std::size_t first = 0, end = 0; first < runs.size(); first = end) {
    const std::int32_t row = runs[first].row;
    while (end < runs.size() && runs[end].row == row) ++end;
    if (row > next_row) AddBand(next_row, {});
    AddBand(row, runs.subspan(first, end - first));
    next_row = row + 1;
  }
  if (!runs.empty()) AddBand(next_row, {});
  spans_.shrink_to_fit();
  bands_.shrink_to_fit();
}

void RimVoids::AddBand(std::int32_t row, std::span<const Run> runs) {
  const auto span_of = [](const Run& run) { return Span{run.first, run.last, run.region}; };
  if (!bands_.empty() && std::ranges::equal(SpansOf(bands_.size() - 1), runs, {}, {}, span_of)) return;
  bands_.push_back({row, static_cast<std::uint32_t>(spans_.size())});
  std::ranges::transform(runs, std::back_inserter(spans_), span_of);
}

std::span<const RimVoids::Span> RimVoids::SpansOf(std::size_t band) const {
  const std::size_t end = band + 1 < bands_.size() ? bands_[band + 1].first_span : spans_.size();
  return std::span(spans_).subspan(bands_[band].first_span, end - bands_[band].first_span);
}

std::vector<RimVoids::Run> RimVoids::Runs() const {
  std::vector<Run> runs;
  for (std::size_t band = 0; band + 1 < bands_.size(); ++band) {
    for (std::int32_t row = bands_[band].row; row < bands_[band + 1].row; ++row) {
      for (const Span& span : SpansOf(band)) runs.push_back({row, span.first, span.last, span.region});
    }
  }
  return runs;
}

RimVoids RimVoids::Everything() {
  RimVoids all;
  all.regions_ = 1;
  all.is_everything_ = true;
  return all;
}

RimVoids::Stretch RimVoids::StretchAt(std::int64_t column, std::int64_t row) const {
  Stretch stretch;
  if (is_everything_) stretch.region = 0;
  const auto next = std::ranges::upper_bound(bands_, row, {}, &Band::row);
  if (next != bands_.end()) stretch.last_row = next->row - 1;
  if (next == bands_.begin()) return stretch;
  const std::span<const Span> spans = SpansOf(static_cast<std::size_t>(next - bands_.begin()) - 1);
  const auto span = std::ranges::partition_point(spans, [&](const Span& s) { return s.last < column; });
  if (span == spans.end()) return stretch;
  const bool is_inside = span->first <= column;
  if (is_inside) stretch.region = span->region;
  stretch.last_column = is_inside ? span->last : span->first - 1;
  return stretch;
}

RimVoidFinder::RimVoidFinder(int columns, int rows, Hole hole, std::size_t max_runs)
    : columns_(columns),
      rows_(rows),
      hole_(std::move(hole)),
      max_runs_(max_runs),
      band_(static_cast<std::size_t>(ChunkGrid::kSide)) {}

std::uint32_t RimVoidFinder::NewRegion() {
  parents_.push_back(static_cast<std::uint32_t>(parents_.size()));
  touches_.push_back(0);
  return parents_.back();
}

std::uint32_t RimVoidFinder::RootOf(std::uint32_t region) {
  while (parents_[region] != region) {
    parents_[region] = parents_[parents_[region]];
    region = parents_[region];
  }
  return region;
}

void RimVoidFinder::Join(std::uint32_t a, std::uint32_t b) {
  a = RootOf(a), b = RootOf(b);
  if (a == b) return;
  if (b < a) std::swap(a, b);
  parents_[b] = a;
  touches_[a] |= touches_[b];
}

void RimVoidFinder::GiveUp() {
  has_given_up_ = true;
  band_.clear();
  frontier_ = rim_ = open_ = {};
  parents_ = {};
  touches_ = {};
}

void RimVoidFinder::AddRun(int chunk_row, std::int32_t first, std::int32_t last) {
  std::vector<Run>& row = band_[static_cast<std::size_t>(chunk_row)];
  if (!row.empty() && row.back().last + 1 == first) {  // continues the run of the previous chunk
    row.back().last = last;
    return;
  }
  row.push_back({top_ + chunk_row, first, last, kNoRegion});
  ++band_runs_;
}

void RimVoidFinder::Add(const Chunk& chunk, const ChunkStatistics& chunk_statistics) {
  if (has_given_up_) return;
  const int used = std::min(chunk.cols, columns_ - chunk.col);
  if (chunk.row != top_) {
    Sweep();
    top_ = chunk.row;
  }
  if (has_given_up_ || used <= 0) return;
  if (chunk_statistics.is_void()) {
    for (int r = 0; r < chunk.rows; ++r) AddRun(r, chunk.col, chunk.col + used - 1);
  } else {
    for (const VoidRun& run : chunk_statistics.voids) AddRun(run.row, chunk.col + run.first, chunk.col + run.last);
  }
  if (band_runs_ > max_runs_) GiveUp();
}

void RimVoidFinder::SweepRow(std::int32_t row, std::vector<Run>& runs) {
  auto above = frontier_.begin();
  for (Run& run : runs) {
    while (above != frontier_.end() && above->last < run.first) ++above;
    for (auto met = above; met != frontier_.end() && met->first <= run.last; ++met) {
      if (run.region == kNoRegion) {
        run.region = RootOf(met->region);
      } else {
        Join(run.region, met->region);
      }
    }
    if (run.region == kNoRegion) run.region = NewRegion();
    if (row == 0 || row == rows_ - 1 || run.first == 0 || run.last == columns_ - 1) touches_[RootOf(run.region)] = 1;
    open_.push_back(run);
  }
  frontier_ = std::move(runs);
  runs.clear();
}

void RimVoidFinder::Sweep() {
  const int rows = std::min<int>(ChunkGrid::kSide, rows_ - top_);
  for (int r = 0; r < rows; ++r) SweepRow(top_ + r, band_[static_cast<std::size_t>(r)]);
  band_runs_ = 0;
  Settle();
  if (rim_.size() + open_.size() > max_runs_) return GiveUp();
  if (parents_.size() > kManyRegions) Renumber();
}

void RimVoidFinder::Settle() {
  std::vector<std::uint8_t> goes_on(parents_.size());
  if (top_ + ChunkGrid::kSide < rows_) {
    for (const Run& run : frontier_) goes_on[RootOf(run.region)] = 1;
  }
  std::vector<std::int64_t> samples(parents_.size());
  for (const Run& run : open_) samples[RootOf(run.region)] += run.last - run.first + 1;
  std::erase_if(open_, [&](const Run& run) {
    const std::uint32_t root = RootOf(run.region);
    if (touches_[root] != 0) {
      rim_.push_back(run);
    } else if (goes_on[root] != 0) {
      return false;
    } else {
      hole_(run.row, run.first, run.last, samples[root]);
    }
    return true;
  });
}

void RimVoidFinder::Renumber() {
  std::vector<std::uint32_t> numbers(parents_.size(), kNoRegion);
  std::vector<std::uint8_t> touches;
  for (std::vector<Run>* runs : {&rim_, &open_, &frontier_}) {
    for (Run& run : *runs) {
      const std::uint32_t root = RootOf(run.region);
      if (numbers[root] == kNoRegion) {
        numbers[root] = static_cast<std::uint32_t>(touches.size());
        touches.push_back(touches_[root]);
      }
      run.region = numbers[root];
    }
  }
  parents_.clear();
  touches_.clear();
  for (const std::uint8_t touch : touches) touches_[NewRegion()] = touch;
}

RimVoids RimVoidFinder::Finish() {
  if (!has_given_up_) Sweep();
  if (has_given_up_) return RimVoids::Everything();
  frontier_.clear();
  std::ranges::sort(rim_, {}, [](const Run& run) { return std::tuple(run.row, run.first); });
  Renumber();
  return {rim_, static_cast<std::uint32_t>(parents_.size())};
}

}  // namespace terrace::dem
