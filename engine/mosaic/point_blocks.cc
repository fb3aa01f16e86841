#include "engine/mosaic/point_blocks.h"

#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

namespace terrace::dem {
namespace {

constexpr std::size_t kNoted = 4096;
// Memory of a block besides its samples: list and index nodes, the block itself.
constexpr std::size_t kOverheadBytes = 512;

std::size_t ChargeOf(const PointBlock& block) { return block.bytes() + kOverheadBytes; }

}  // namespace

void PointBlock::Compact() {
  if (has_voids() || bridged.empty()) return;
  constexpr float kMin = std::numeric_limits<std::int16_t>::min(), kMax = std::numeric_limits<std::int16_t>::max();
  const float first = bridged.front();
  bool is_level = true, is_whole = true;
  for (const float sample : bridged) {
    is_level &= sample == first;
    is_whole &= sample >= kMin && sample <= kMax && sample == std::trunc(sample);
  }
  if (is_level) {
    uniform_height = first;
  } else if (is_whole) {
    whole.reserve(bridged.size());
    for (const float sample : bridged) whole.push_back(static_cast<std::int16_t>(sample));
  } else {
    return;
  }
  bridged = {};
}

std::optional<double> PointBlock::HeightAt(const GridCell& cell) const {
  if (uniform_height) return *uniform_height;
  if (whole.empty()) return Interpolate(smooth.empty() ? bridged : smooth, window, cell);
  // The same numbers in the same order as Interpolate.
  const auto lerp = [](double first, double second, double weight) { return first + weight * (second - first); };
  const std::int16_t* const samples =
      whole.data() + (cell.row - window.row) * window.columns + (cell.column - window.column);
  const std::int64_t east = cell.x > 0 ? 1 : 0, south = cell.y > 0 ? window.columns : 0;
  return lerp(lerp(samples[0], samples[east], cell.x), lerp(samples[south], samples[south + east], cell.x), cell.y);
}

std::vector<float> PointBlock::Samples() const { return smooth.empty() ? Bridged() : smooth; }

std::vector<float> PointBlock::Bridged() const {
  if (uniform_height)
    return std::vector<float>(static_cast<std::size_t>(window.columns * window.rows), *uniform_height);
  return whole.empty() ? bridged : std::vector<float>(whole.begin(), whole.end());
}

std::size_t PointBlockCache::Hash::operator()(const PointBlockKey& key) const noexcept {
  std::uint64_t hash = key.grid * 0x9E3779B97F4A7C15;
  for (const std::int64_t number : {key.column, key.row}) {
    hash = (hash ^ static_cast<std::uint64_t>(number)) * 0xBF58476D1CE4E5B9;
    hash ^= hash >> 29;
  }
  return hash;
}

PointBlockCache& PointBlockCache::Shared() {
  static auto* const cache = new PointBlockCache();
  return *cache;
}

void PointBlockCache::Insert(const PointBlockKey& key, PointBlockPtr block) {
  const std::size_t bytes = ChargeOf(*block);
  blocks_.Insert(key, std::move(block), bytes);
}

bool PointBlockCache::Note(const PointBlockKey& key) {
  const std::lock_guard lock(mutex_);
  noted_.resize(kNoted);
  return std::exchange(noted_[Hash{}(key) % kNoted], key) == key;
}

}  // namespace terrace::dem
