#include "engine/dem/bound/loose_cells.h"

#include <algorithm>
#include <functional>

namespace terrace::dem {
namespace {

// Limit of samples for one tile and raster grid: about as many as the tile's heights are averaged from at the largest
// factor of MayRead.
constexpr std::int64_t kMaxSamples = std::int64_t{1} << 20;

}  // namespace

void LooseCells::Add(const TileCell& cell, const CellErrorBound::CellSamples& place, double error) {
  groups_.back().cells.push_back({cell, place, error});
  groups_.back().error = std::max(groups_.back().error, error);
}

Result<void> LooseCells::Read(double& bound, const std::stop_token& stop) {
  // Largest bounds first: their results make reads of smaller ones unnecessary.
  std::ranges::stable_sort(groups_, std::ranges::greater(), &Group::error);
  std::int64_t left = kMaxSamples;
  for (const Group& group : groups_) {
    if (group.error <= bound) return {};
    SampleBox all;
    for (const Cell& loose : group.cells) {
      if (loose.error > bound && !loose.place.samples.empty()) all = all.Around(loose.place.samples);
    }
    if (all.empty()) continue;
    if (all.columns() > left || all.rows() > left || all.columns() * all.rows() > left) {
      bound = group.error;
      return {};
    }
    left -= all.columns() * all.rows();
    const GridWindow window{all.west, all.north, all.columns(), all.rows()};
    const auto samples = grid_.ReadSamples(window, stop);
    if (!samples) return tl::unexpected(samples.error());
    for (const Cell& loose : group.cells) {
      if (loose.error <= bound) continue;
      bound = std::max(bound, std::min(loose.error, single_.OfSamples(loose.cell, loose.place, window, *samples, 0)));
    }
  }
  return {};
}

}  // namespace terrace::dem
