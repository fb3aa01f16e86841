// Combines the samples of a raster grid's members into one grid of averages.
#include <algorithm>
#include <cmath>

#include "engine/geo/tile_cover.h"
#include "engine/mosaic/raster_grid.h"
#include "engine/raster/block_averages.h"

namespace terrace::dem {
namespace {

// Blocks of a member along one axis: the first one, their number, and the number of samples in the last one.
struct BlockSpan {
  std::int64_t first, count, last_samples;

  static BlockSpan Of(std::int64_t start, std::int64_t samples, int step) {
    const std::int64_t count = (samples + step - 1) / step;
    return {start / step, count, samples - (count - 1) * step};
  }
  std::int64_t end() const { return first + count - 1; }
  std::int64_t SamplesIn(std::int64_t block, int step) const { return block == end() ? last_samples : step; }
};

// A window whose blocks are filled by one member after the other. If several members have a block, the one with the
// most samples in it is used, the first among equals: at a member's edge the neighbour has the rest of the block.
class Patchwork {
 public:
  Patchwork(int step, const GridWindow& window, float* blocks)
      : step_(step),
        window_(window),
        blocks_(blocks),
        samples_(static_cast<std::size_t>(window.columns * window.rows)) {
    std::fill_n(blocks_, samples_.size(), SampleRules::kVoid);
  }

  // The part of a member in the window, if it can add anything there; else empty.
  GridWindow Wanted(const BlockSpan& columns, const BlockSpan& rows) const {
    const PixelRange here = geo::Intersection(
        {columns.first, rows.first, columns.end(), rows.end()},
        {window_.column, window_.row, window_.column + window_.columns - 1, window_.row + window_.rows - 1});
    for (std::int64_t y = here.start_y; y <= here.end_y; ++y) {
      for (std::int64_t x = here.start_x; x <= here.end_x; ++x) {
        if (samples_[At(x, y)] < columns.SamplesIn(x, step_) * rows.SamplesIn(y, step_)) {
          return {here.start_x, here.start_y, here.end_x - here.start_x + 1, here.end_y - here.start_y + 1};
        }
      }
    }
    return {};
  }

  void Add(const GridWindow& part, const std::vector<float>& heights, const BlockSpan& columns, const BlockSpan& rows) {
    std::size_t i = 0;
    for (std::int64_t y = part.row; y < part.row + part.rows; ++y) {
      for (std::int64_t x = part.column; x < part.column + part.columns; ++x, ++i) {
        const std::int64_t samples = columns.SamplesIn(x, step_) * rows.SamplesIn(y, step_);
        const std::size_t at = At(x, y);
        if (std::isnan(heights[i]) || samples_[at] >= samples) continue;
        blocks_[at] = heights[i];
        samples_[at] = samples;
      }
    }
  }

 private:
  std::size_t At(std::int64_t x, std::int64_t y) const {
    return static_cast<std::size_t>((y - window_.row) * window_.columns + x - window_.column);
  }

  const int step_;
  const GridWindow window_;
  float* const blocks_;
  std::vector<std::int64_t> samples_;  // samples of each block, in the member that filled it
};

}  // namespace

Result<void> RasterGrid::Compose(int step, const GridWindow& window, float* out, const std::stop_token& stop) const {
  Patchwork patchwork(step, window, out);
  const auto pixels = [step](std::int64_t blocks) { return static_cast<double>(blocks * step); };
  const Box box{pixels(window.column), pixels(window.row), pixels(window.column + window.columns),
                pixels(window.row + window.rows)};
  for (const std::size_t i : member_index_.Find(box)) {
    const RasterSource& raster = *members_[i].raster;
    const BlockSpan rows = BlockSpan::Of(members_[i].row, raster.layout().height, step);
    for (const std::int64_t turn : {0, -1, 1}) {
      if (turn != 0 && !wraps_) break;
      const BlockSpan columns = BlockSpan::Of(members_[i].column + turn * columns_, raster.layout().columns, step);
      const GridWindow wanted = patchwork.Wanted(columns, rows);
      if (wanted.columns == 0) continue;
      const auto heights = raster.ReadAverages(
          step, {wanted.column - columns.first, wanted.row - rows.first, wanted.columns, wanted.rows}, stop);
      if (!heights) return tl::unexpected(heights.error());
      patchwork.Add(wanted, *heights, columns, rows);
    }
  }
  return {};
}

Result<std::vector<float>> RasterGrid::ReadAverages(int factor, const GridWindow& window,
                                                    const std::stop_token& stop) const {
  if (members_.size() == 1) return members_.front().raster->ReadAverages(factor, window, stop);
  const int step = std::min(alignment_, factor);
  return AverageBlocks(Columns(step), Rows(step), step, factor / step, window,
                       [&](const GridWindow& blocks, const AddRows& add) -> Result<void> {
                         std::vector<float> values(static_cast<std::size_t>(blocks.columns * blocks.rows));
                         if (auto done = Compose(step, blocks, values.data(), stop); !done) return done;
                         add(values.data(), blocks.rows);
                         return {};
                       });
}

}  // namespace terrace::dem
