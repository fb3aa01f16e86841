#include "engine/statistics/memory_averages.h"

#include <algorithm>
#include <utility>

#include "engine/statistics/kept_factors.h"

namespace terrace::dem {

MemoryAverages::MemoryAverages(std::shared_ptr<AveragesBudget> budget, std::vector<Level> levels, std::size_t bytes)
    : budget_(std::move(budget)), levels_(std::move(levels)), bytes_(bytes) {}

MemoryAverages::~MemoryAverages() { budget_->Give(bytes_); }

std::unique_ptr<MemoryAverages> MemoryAverages::Make(const RasterLayout& layout,
                                                     std::shared_ptr<AveragesBudget> budget) {
  constexpr std::size_t kShare = 8;
  const unsigned kept = KeptFactors(layout);
  const std::size_t most = budget->left() / kShare;
  std::vector<Level> levels;
  std::size_t bytes = 0;
  for (int factor = kLargestMeasuredFactor / 2; factor > 1; factor /= 2) {
    if ((kept & static_cast<unsigned>(factor)) == 0) continue;
    AveragesGrid grid{DivideUp(layout.columns, factor), DivideUp(layout.height, factor), {}};
    const std::size_t more = static_cast<std::size_t>(grid.columns * grid.rows) * sizeof(float);
    if (bytes + more > most) break;
    bytes += more;
    levels.insert(levels.begin(), Level{factor, std::move(grid)});
  }
  if (levels.empty() || !budget->Take(bytes)) return nullptr;
  // Owns the bytes before it allocates memory, because the allocation may fail.
  std::unique_ptr<MemoryAverages> averages(new MemoryAverages(std::move(budget), std::move(levels), bytes));
  for (Level& level : averages->levels_) {
    level.grid.heights.assign(static_cast<std::size_t>(level.grid.columns * level.grid.rows), SampleRules::kVoid);
  }
  return averages;
}

void MemoryAverages::Add(const Chunk& chunk, const ChunkStatistics& chunk_statistics) {
  const auto used = [&](const Level& level) { return level.grid.columns - chunk.col / level.factor; };
  for (Level& level : levels_) {
    std::size_t k = 0;
    while ((2 << k) < level.factor) ++k;
    if (k >= chunk_statistics.averages.size() || chunk_statistics.averages[k].empty()) continue;
    const std::vector<float>& averages = chunk_statistics.averages[k];
    const std::int64_t rows = DivideUp(chunk.rows, level.factor);
    const std::int64_t columns = static_cast<std::int64_t>(averages.size()) / rows;
    if (columns > used(level)) continue;
    for (std::int64_t row = 0; row < rows; ++row) {
      const std::int64_t at = (chunk.row / level.factor + row) * level.grid.columns + chunk.col / level.factor;
      std::copy_n(averages.begin() + row * columns, columns, level.grid.heights.begin() + at);
    }
  }
}

bool MemoryAverages::Has(int factor) const {
  return std::ranges::any_of(levels_, [factor](const Level& level) { return level.factor == factor; });
}

std::vector<float> MemoryAverages::Read(int factor, const GridWindow& window) const {
  return std::ranges::find(levels_, factor, &Level::factor)->grid.Read(window);
}

}  // namespace terrace::dem
