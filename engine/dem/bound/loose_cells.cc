#include "engine/dem/bound/loose_cells.h"

#include <algorithm>
#include <functional>

namespace terrace::dem {
namespace {

// For one tile and sheet: about as many as its own heights are averaged from at the largest factor of MayRead.
constexpr std::int64_t kMostSamples = std::int64_t{1} << 20;

}  // namespace

void LooseCells::Add(const TileCell& cell, const CellGap::Place& place, double gap) {
  groups_.back().cells.push_back({cell, place, gap});
  groups_.back().gap = std::max(groups_.back().gap, gap);
}

Result<void> LooseCells::Read(double& bound, const std::stop_token& stop) {
  // The largest first: what they come to makes others not worth looking at.
  std::ranges::stable_sort(groups_, std::ranges::greater(), &Group::gap);
  std::int64_t left = kMostSamples;
  for (const Group& group : groups_) {
    if (group.gap <= bound) return {};
    SampleBox all;
    for (const Cell& loose : group.cells) {
      if (loose.gap > bound && !loose.place.samples.empty()) all = all.Around(loose.place.samples);
    }
    if (all.empty()) continue;
    if (all.columns() > left || all.rows() > left || all.columns() * all.rows() > left) {
      bound = group.gap;
      return {};
    }
    left -= all.columns() * all.rows();
    const GridWindow window{all.west, all.north, all.columns(), all.rows()};
    const auto samples = sheet_.ReadSamples(window, stop);
    if (!samples) return tl::unexpected(samples.error());
    for (const Cell& loose : group.cells) {
      if (loose.gap <= bound) continue;
      bound = std::max(bound, std::min(loose.gap, single_.OfSamples(loose.cell, loose.place, window, *samples, 0)));
    }
  }
  return {};
}

}  // namespace terrace::dem
