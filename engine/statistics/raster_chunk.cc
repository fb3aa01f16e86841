#include "engine/statistics/raster_chunk.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/statistics/averaging_errors.h"
#include "engine/statistics/kept_factors.h"
#include "engine/statistics/sample_rows.h"

namespace terrace::dem {
namespace {

// How far averages of the largest directly compared factor extend beyond a chunk.
constexpr int kHalo = kLargestMeasuredFactor;

// The raster's factors from `least` to `most`.
template <typename Visit>
void ForEachFactor(const RasterLayout& layout, int least, int most, const Visit& visit) {
  for (int factor = 2; factor <= most; factor *= 2) {
    if (factor >= least) visit(factor);
    if (factor >= std::max(layout.width, layout.height)) return;
  }
}

// Samples of a box of the raster.
struct Samples {
  Chunk box;
  std::unique_ptr<float[]> heights;

  const float* Row(int row) const { return heights.get() + IndexAt(0, row - box.row, box.cols); }
};

// Returns false if the file stores nothing there and GDAL's replacement value is a void.
bool MayHaveSamples(GDALRasterBand& band, const RasterLayout& layout, const Chunk& chunk) {
  const int status = band.GetDataCoverageStatus(chunk.col, chunk.row, chunk.cols, chunk.rows, 0, nullptr);
  if (status != GDAL_DATA_COVERAGE_STATUS_EMPTY || layout.rules.has_mask) return true;
  int has = 0;
  const double nodata = band.GetNoDataValue(&has);
  return !std::isnan(layout.rules.ToHeight(has != 0 ? nodata : 0));
}

Chunk WithHalo(const Chunk& chunk, const RasterLayout& layout) {
  const int west = std::max(0, chunk.col - kHalo), north = std::max(0, chunk.row - kHalo);
  return {west, north, std::min(layout.width, chunk.col + chunk.cols + kHalo) - west,
          std::min(layout.height, chunk.row + chunk.rows + kHalo) - north};
}

// Appends the runs of voids among the first `used` samples of a row.
void AddVoidRuns(const float* row, int r, int used, std::vector<VoidRun>& runs) {
  for (int c = 0; c < used; ++c) {
    if (!std::isnan(row[c])) continue;
    const int first = c;
    while (c + 1 < used && std::isnan(row[c + 1])) ++c;
    runs.push_back({static_cast<std::uint16_t>(r), static_cast<std::uint16_t>(first), static_cast<std::uint16_t>(c)});
  }
}

void CountSamples(const Samples& samples, const Chunk& chunk, const RasterLayout& layout, ChunkStatistics& statistics) {
  statistics.zeros.Add(samples.Row(chunk.row) + (chunk.col - samples.box.col), samples.box.cols, chunk, layout.width,
                       layout.height, layout.coast_step_m);
  const int columns = DivideUp(chunk.cols, RangeTable::kBlock);
  for (int r = 0; r < chunk.rows; ++r) {
    const float* row = samples.Row(chunk.row + r) + (chunk.col - samples.box.col);
    BlockRange* ranges = statistics.ranges.data() + std::ptrdiff_t{r / RangeTable::kBlock} * columns;
    const std::int64_t before = statistics.valid;
    for (int c = 0; c < chunk.cols; c += RangeTable::kBlock, ++ranges) {
      const int count = std::min(RangeTable::kBlock, chunk.cols - c);
      statistics.valid += AddToRange({row + c, static_cast<std::size_t>(count)}, *ranges);
    }
    const int used = std::clamp(layout.columns - chunk.col, 0, chunk.cols);
    if (statistics.valid - before < chunk.cols) AddVoidRuns(row, r, used, statistics.voids);
    const auto add = [&](BlockSum& sum) {
      for (int c = 0; c < used; ++c) sum.Add(row[c]);
    };
    if (chunk.row + r == 0) add(statistics.first_row);
    if (chunk.row + r == layout.height - 1) add(statistics.last_row);
  }
}

ContentHash HashOf(const Samples& samples, const Chunk& chunk) {
  ContentHasher hasher;
  for (int r = 0; r < chunk.rows; ++r) {
    const float* row = samples.Row(chunk.row + r) + (chunk.col - samples.box.col);
    hasher.AddBytes(row, static_cast<std::size_t>(chunk.cols) * sizeof(float));
  }
  return hasher.Hash();
}

// All averages that the surface over a chunk's samples is interpolated from.
struct Averages {
  GridWindow window;
  std::vector<float> heights;

  const float* Row(std::int64_t row) const { return heights.data() + (row - window.row) * window.columns; }
};

GridWindow AveragesAround(const Chunk& chunk, const RasterLayout& layout, int factor) {
  const GridAxis columns(layout.columns, factor, layout.wraps), rows(layout.height, factor, false);
  const int used = std::min(chunk.cols, layout.columns - chunk.col);
  std::int64_t west = chunk.col / factor - 1, east = (chunk.col + used - 1) / factor + 1;
  if (!layout.wraps) west = std::max<std::int64_t>(west, 0), east = std::min(east, columns.count() - 1);
  const std::int64_t north = std::max(chunk.row / factor - 1, 0);
  const std::int64_t south = std::min<std::int64_t>((chunk.row + chunk.rows - 1) / factor + 1, rows.count() - 1);
  return {west, north, east - west + 1, south - north + 1};
}

// The largest factor up to kLargestMeasuredFactor whose averages start from the samples, not from an overview; 1: none.
int LargestSummedFactor(const RasterLayout& layout) {
  int summed = 1;
  ForEachFactor(layout, 2, kLargestMeasuredFactor, [&](int factor) {
    if (StartingFactor(layout, factor) == 1) summed = factor;
  });
  return summed;
}

// Averages around a chunk, and sums of its blocks.
struct BlocksOfChunk {
  std::vector<Averages> averages;           // of the factors 2, 4, ...
  std::vector<std::vector<BlockSum>> sums;  // of the factors 128, 256, ...; row by row
};

// Sums samples to averages of the factors up to `largest`, and to the sums of all larger factors that start from
// samples.
BlocksOfChunk SumBlocks(const Samples& samples, const Chunk& chunk, const RasterLayout& layout, int largest) {
  const Chunk& box = samples.box;  // begins at a block of the largest factor
  const int width = std::min(box.col + box.cols, layout.columns) - box.col;
  const int used = std::min(chunk.cols, layout.columns - chunk.col);
  const auto index_of = [](int side) {
    return static_cast<std::size_t>(std::countr_zero(static_cast<unsigned>(side)) - 1);
  };
  BlocksOfChunk blocks;
  ForEachFactor(layout, 2 * kLargestMeasuredFactor, ChunkGrid::kSide, [&](int) { blocks.sums.emplace_back(); });
  const auto add_sums = [&](int side, std::int64_t, std::span<const BlockSum> sums) {
    const int factor = side * kLargestMeasuredFactor;
    if (index_of(side) >= blocks.sums.size() || StartingFactor(layout, factor) > 1) return;
    std::vector<BlockSum>& to = blocks.sums[index_of(side)];
    to.insert(to.end(), sums.begin(), sums.begin() + DivideUp(used, factor));
  };
  BlockSums large(DivideUp(used, kLargestMeasuredFactor), ChunkGrid::kSide / kLargestMeasuredFactor);
  for (int factor = 2; factor <= largest; factor *= 2) {
    const GridWindow window = AveragesAround(chunk, layout, factor);
    blocks.averages.push_back({window, std::vector<float>(static_cast<std::size_t>(window.columns * window.rows))});
  }
  const auto add_averages = [&](int factor, std::int64_t row, std::span<const BlockSum> sums) {
    Averages& to = blocks.averages[index_of(factor)];
    const GridWindow& window = to.window;
    const std::int64_t at = box.row / factor + row, first = box.col / factor;
    if (at >= window.row && at < window.row + window.rows) {
      const std::int64_t west = std::max(window.column, first);
      const std::int64_t east = std::min(window.column + window.columns, first + DivideUp(width, factor));
      WriteMeans(sums.subspan(static_cast<std::size_t>(west - first), static_cast<std::size_t>(east - west)),
                 to.heights.data() + IndexAt(west - window.column, at - window.row, window.columns));
    }
    if (factor != kLargestMeasuredFactor || at * factor < chunk.row || at * factor >= chunk.row + chunk.rows) return;
    large.AddRow(sums.subspan(static_cast<std::size_t>((chunk.col - box.col) / factor),
                              static_cast<std::size_t>(DivideUp(used, factor))),
                 add_sums);
  };
  BlockSums small(width, largest);
  for (int row = box.row; row < box.row + box.rows; ++row) small.AddRow(samples.Row(row), width, 1, 1, add_averages);
  small.Finish(add_averages);
  large.Finish(add_sums);
  return blocks;
}

// Adds averages from around the Earth, which the box of samples does not reach.
Result<Averages> ReadAround(GDALDataset& dataset, const RasterLayout& layout, const Chunk& box, int factor,
                            const std::stop_token& stop, Averages averages) {
  const GridWindow& window = averages.window;
  const std::int64_t first = box.col / factor;
  const std::int64_t end = DivideUp(std::min(box.col + box.cols, layout.columns), factor);
  for (std::int64_t c = 0; c < window.columns; ++c) {
    const std::int64_t column = window.column + c;
    if (column >= first && column < end) continue;
    const auto read = ReadAverages(dataset, layout, factor, {column, window.row, 1, window.rows}, stop);
    if (!read) return tl::unexpected(read.error());
    for (std::int64_t r = 0; r < window.rows; ++r) {
      averages.heights[IndexAt(c, r, window.columns)] = (*read)[static_cast<std::size_t>(r)];
    }
  }
  return averages;
}

Result<Averages> ReadFromOverview(GDALDataset& dataset, const RasterLayout& layout, const Chunk& chunk, int factor,
                                  const std::stop_token& stop) {
  const GridWindow window = AveragesAround(chunk, layout, factor);
  auto heights = ReadAverages(dataset, layout, factor, window, stop);
  if (!heights) return tl::unexpected(heights.error());
  return Averages{window, *std::move(heights)};
}

// Adds the differences between one row of samples and the surface between averages to its blocks.
class RowErrors {
 public:
  // `block`: samples along a side of the blocks; a multiple of the factor.
  RowErrors(const Averages& averages, const Chunk& chunk, const RasterLayout& layout, int factor, int block)
      : averages_(averages),
        rows_(layout.height, factor, false),
        line_(static_cast<std::size_t>(averages.window.columns) + 1) {
    const GridAxis columns(layout.columns, factor, layout.wraps);
    const int used = std::min(chunk.cols, layout.columns - chunk.col);
    for (int c = 0; c < used; ++c) {
      GridAxis::Location place = columns.Locate(chunk.col + c + 0.5);
      place.index -= averages.window.column;
      // An index past the end with weight 0 is replaced by its neighbour.
      if (place.index + 1 >= averages.window.columns) place = {averages.window.columns - 2, 1};
      if (averages.window.columns == 1) place = {0, 0};
      places_.push_back(place);
    }
    for (int k = 0; k < factor; ++k) weights_.push_back((k + 0.5) / factor);
    for (int first = 0; first < used; first += block) parts_.push_back(PartOf(first, std::min(first + block, used)));
  }

  void Add(const float* samples, int row, float* errors) {
    const GridAxis::Location place = rows_.Locate(row + 0.5);
    const float* upper = averages_.Row(place.index);
    const float* lower = place.weight > 0 ? averages_.Row(place.index + 1) : upper;
    for (std::size_t i = 0; i + 1 < line_.size(); ++i) {
      line_[i] = upper[i] * (1 - place.weight) + lower[i] * place.weight;
    }
    line_.back() = line_[line_.size() - 2];  // has no weight
    for (const Part& part : parts_) {
      const double* const first = line_.data() + places_[static_cast<std::size_t>(part.first)].index;
      const double* const last = line_.data() + places_[static_cast<std::size_t>(part.end - 1)].index + 1;
      double sum = 0;  // NaN if an average is void
      for (const double* at = first; at <= last; ++at) sum += *at;
      *errors = std::max(*errors, std::isnan(sum) ? WithVoids(samples, upper, lower, place.weight, part.first, part.end)
                                                  : Plain(samples, part));
      ++errors;
    }
  }

 private:
  // Columns first .. end - 1, a block. In the middle are whole runs of samples between two averages.
  struct Part {
    int first, middle, middle_end, end;
  };

  // The averages at the ends of an axis have no others beyond them; samples there do not lie in whole runs.
  Part PartOf(int first, int end) const {
    const auto length = static_cast<int>(weights_.size());
    const auto is_whole = [&](int begin) {
      for (int k = 0; k < length; ++k) {
        const GridAxis::Location& place = places_[static_cast<std::size_t>(begin + k)];
        if (place.index != places_[static_cast<std::size_t>(begin)].index) return false;
        if (place.weight != weights_[static_cast<std::size_t>(k)]) return false;
      }
      return true;
    };
    int middle = std::min(first + length / 2, end), middle_end = middle;
    if (middle + length <= end && !is_whole(middle)) middle_end = middle = std::min(middle + length, end);
    while (middle_end + length <= end && is_whole(middle_end)) middle_end += length;
    return {first, middle, middle_end, end};
  }

  float Plain(const float* samples, const Part& part) const {
    double worst = 0;
    const auto add = [&](int first, int end) {
      for (int c = first; c < end; ++c) {
        const auto& [index, weight] = places_[static_cast<std::size_t>(c)];
        const double* at = line_.data() + index;
        const double error = std::abs(at[0] + weight * (at[1] - at[0]) - double{samples[c]});
        if (error > worst) worst = error;  // never for a void
      }
    };
    add(part.first, part.middle);
    if (part.middle_end > part.middle) {
      const double* const averages = line_.data() + places_[static_cast<std::size_t>(part.middle)].index;
      const std::size_t runs = static_cast<std::size_t>(part.middle_end - part.middle) / weights_.size();
      worst = std::max(worst, LargestDistance({samples + part.middle, averages, runs, weights_}));
    }
    add(part.middle_end, part.end);
    return Up(worst);
  }

  float WithVoids(const float* samples, const float* upper, const float* lower, double weight, int first,
                  int end) const {
    double worst = 0;
    for (int c = first; c < end; ++c) {
      if (std::isnan(samples[c])) continue;
      const auto& [index, x] = places_[static_cast<std::size_t>(c)];
      const std::int64_t next = std::min<std::int64_t>(index + 1, averages_.window.columns - 1);
      double sum = 0, weights = 0;
      const auto add = [&](float height, double share) {
        if (share <= 0 || std::isnan(height)) return;
        sum += share * height;
        weights += share;
      };
      add(upper[index], (1 - x) * (1 - weight));
      add(upper[next], x * (1 - weight));
      add(lower[index], (1 - x) * weight);
      add(lower[next], x * weight);
      worst = std::max(
          worst, weights > 0 ? std::abs(sum / weights - double{samples[c]}) : std::numeric_limits<double>::infinity());
    }
    return Up(worst);
  }

  // Infinity, where no bound is known, stays infinity.
  static float Up(double error) {
    return std::nextafter(static_cast<float>(error), std::numeric_limits<float>::infinity());
  }

  const Averages& averages_;
  const GridAxis rows_;
  std::vector<GridAxis::Location> places_;  // by column of the chunk, within the window
  std::vector<double> weights_;             // of a whole run
  std::vector<Part> parts_;
  std::vector<double> line_;
};

Result<void> CompareAverages(GDALDataset& dataset, const RasterLayout& layout, const Samples& samples,
                             const Chunk& chunk, const std::stop_token& stop, ChunkStatistics& statistics) {
  if (chunk.col >= layout.columns) return {};
  statistics.averages.clear();
  const unsigned kept = KeptFactors(layout);
  const int summed = LargestSummedFactor(layout);
  BlocksOfChunk blocks;
  if (summed > 1) blocks = SumBlocks(samples, chunk, layout, summed);
  statistics.sums = std::move(blocks.sums);
  Result<void> result;
  ForEachFactor(layout, 2, kLargestMeasuredFactor, [&](int factor) {
    if (!result) return;
    const std::size_t k = statistics.averages.size();
    auto averages = factor <= summed
                        ? ReadAround(dataset, layout, samples.box, factor, stop, std::move(blocks.averages[k]))
                        : ReadFromOverview(dataset, layout, chunk, factor, stop);
    if (!averages) {
      result = tl::unexpected(averages.error());
      return;
    }
    const int pixels = AveragingErrors::BlockPixels(factor), columns = DivideUp(chunk.cols, pixels);
    std::vector<float>& errors = statistics.errors[k];
    RowErrors rows(*averages, chunk, layout, factor, pixels);
    for (int r = 0; r < chunk.rows; ++r) {
      rows.Add(samples.Row(chunk.row + r) + (chunk.col - samples.box.col), chunk.row + r,
               errors.data() + std::ptrdiff_t{r / pixels} * columns);
    }
    std::vector<float>& of_chunk = statistics.averages.emplace_back();
    if (StartingFactor(layout, factor) > 1 && (kept & static_cast<unsigned>(factor)) == 0) return;
    const int used = std::min(chunk.cols, layout.columns - chunk.col), columns_used = DivideUp(used, factor);
    const std::int64_t first = chunk.col / factor, top = chunk.row / factor;
    const int rows_used = DivideUp(chunk.rows, factor);
    of_chunk.reserve(Area(columns_used, rows_used));
    for (std::int64_t r = 0; r < rows_used; ++r) {
      const float* row = averages->Row(top + r) + (first - averages->window.column);
      of_chunk.insert(of_chunk.end(), row, row + columns_used);
    }
  });
  return result;
}

// A chunk without a valid sample. Overviews are interpolated, so that their averages may have heights there.
Result<ChunkStatistics> VoidOrOverviews(GDALDataset& dataset, const RasterLayout& layout, const Chunk& chunk,
                                        const std::stop_token& stop) {
  ChunkStatistics statistics = VoidStatistics(chunk, layout);
  const unsigned kept = KeptFactors(layout);
  const int used = std::min(chunk.cols, layout.columns - chunk.col);
  bool has_heights = false;
  for (std::size_t k = 0; (kept >> k) > 1 && used > 0; ++k) {
    const int factor = 2 << k;
    if ((kept & static_cast<unsigned>(factor)) == 0) continue;
    std::vector<float>& averages = statistics.averages[k];
    const GridWindow window{chunk.col / factor, chunk.row / factor, DivideUp(used, factor),
                            DivideUp(chunk.rows, factor)};
    if (StartingFactor(layout, factor) == 1) {
      averages.assign(static_cast<std::size_t>(window.columns * window.rows), SampleRules::kVoid);
      continue;
    }
    auto read = ReadAverages(dataset, layout, factor, window, stop);
    if (!read) return tl::unexpected(read.error());
    averages = *std::move(read);
    has_heights |= !std::ranges::all_of(averages, [](float height) { return std::isnan(height); });
  }
  return has_heights ? statistics : VoidStatistics(chunk, layout);
}

}  // namespace

bool ChunkStatistics::has_averages(unsigned factors) const {
  for (std::size_t k = 0; k < averages.size(); ++k) {
    if ((factors & (2U << k)) != 0 && !averages[k].empty()) return true;
  }
  return false;
}

Chunk ChunkGrid::At(int index) const {
  const int col = index % columns_ * kSide, row = index / columns_ * kSide;
  return {col, row, std::min(kSide, width_ - col), std::min(kSide, height_ - row)};
}

std::string DescribeWideBlocks(GDALDataset& dataset) {
  GDALRasterBand& band = *dataset.GetRasterBand(1);
  int width = 0, height = 0;
  band.GetBlockSize(&width, &height);
  width = std::min(width, band.GetXSize());
  if (width <= 2 * ChunkGrid::kSide) return {};
  const std::int64_t blocks = DivideUp(ChunkGrid::kSide + 2 * kHalo, height) + 1;  // a chunk begins within one
  const std::int64_t rows = std::min<std::int64_t>(blocks * height, band.GetYSize());
  const std::int64_t needed = width * rows * GDALGetDataTypeSizeBytes(band.GetRasterDataType());
  const std::int64_t cache = GDALGetCacheMax64();
  if (needed <= cache) return {};
  return fmt::format(
      "is stored in blocks of {} x {} samples: preparing it decodes each of them {} times, unless gdal_cache_bytes "
      "is at least {} MiB (it is {} MiB); rewrite it with `gdal_translate -co TILED=YES -co COMPRESS=DEFLATE in "
      "out.tif`",
      width, height, DivideUp(width, ChunkGrid::kSide), (needed >> 20) + 1, cache >> 20);
}

ChunkStatistics VoidStatistics(const Chunk& chunk, const RasterLayout& layout) {
  ChunkStatistics statistics;
  const auto blocks = [&](int pixels) { return Area(DivideUp(chunk.cols, pixels), DivideUp(chunk.rows, pixels)); };
  BlockRange voids;
  voids.has_voids = true;
  statistics.ranges.assign(blocks(RangeTable::kBlock), voids);
  ForEachFactor(layout, 2, kLargestMeasuredFactor, [&](int factor) {
    statistics.errors.emplace_back(blocks(AveragingErrors::BlockPixels(factor)));
    statistics.averages.emplace_back();
  });
  ForEachFactor(layout, 2 * kLargestMeasuredFactor, ChunkGrid::kSide, [&](int) { statistics.sums.emplace_back(); });
  return statistics;
}

std::size_t AveragesIn(const Chunk& chunk, const RasterLayout& layout, int factor) {
  const int used = layout.columns - chunk.col;
  if (used <= 0 || StartingFactor(layout, factor) > 1) return 0;
  return static_cast<std::size_t>(DivideUp(std::min(used, chunk.cols), factor)) *
         static_cast<std::size_t>(DivideUp(chunk.rows, factor));
}

bool CanShareDataset(const RasterLayout& layout) { return layout.overview_factors.empty() && !layout.wraps; }

Result<ChunkStatistics> ReadChunkStatistics(GDALDataset& dataset, const RasterLayout& layout, const Chunk& chunk,
                                            std::int64_t& chunks_read, const std::stop_token& stop,
                                            std::mutex* dataset_mutex) {
  std::unique_lock<std::mutex> lock;
  if (dataset_mutex != nullptr) lock = std::unique_lock(*dataset_mutex);
  GDALRasterBand& band = *dataset.GetRasterBand(1);
  ChunkStatistics statistics = VoidStatistics(chunk, layout);
  if (!MayHaveSamples(band, layout, chunk)) return VoidOrOverviews(dataset, layout, chunk, stop);
  ++chunks_read;
  const Chunk box = WithHalo(chunk, layout);
  const Samples samples{box, std::make_unique_for_overwrite<float[]>(Area(box.cols, box.rows))};
  if (auto done = ReadHeights(band, layout.rules, box.col, box.row, box.cols, box.rows, samples.heights.get(), stop);
      !done) {
    return tl::unexpected(done.error());
  }
  if (lock) lock.unlock();
  for (BlockRange& range : statistics.ranges) range = {};
  CountSamples(samples, chunk, layout, statistics);
  if (statistics.is_void()) return VoidOrOverviews(dataset, layout, chunk, stop);
  statistics.content = HashOf(samples, chunk);
  if (auto compared = CompareAverages(dataset, layout, samples, chunk, stop, statistics); !compared) {
    return tl::unexpected(compared.error());
  }
  return statistics;
}

}  // namespace terrace::dem
