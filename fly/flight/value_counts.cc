#include "fly/flight/value_counts.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace terrace::fly {

void ValueCounts::Add(double value, std::uint64_t times) {
  if (times == 0) return;
  constexpr std::uint32_t kDropped = 0xFFF;  // the last 12 of the 23 bits of a float's fraction
  const auto single = static_cast<float>(value);
  counts_[std::bit_cast<float>(std::bit_cast<std::uint32_t>(single) & ~kDropped)] += times;
  size_ += times;
  largest_ = std::max(largest_, single);
}

void ValueCounts::AddAbove(double limit, const ValueCounts& other) {
  for (auto i = other.counts_.upper_bound(static_cast<float>(limit)); i != other.counts_.end(); ++i) {
    Add(i->first, i->second);
  }
  if (other.largest_ > limit) largest_ = std::max(largest_, other.largest_);
}

double ValueCounts::Percentile(double share) const {
  if (size_ == 0) return 0;
  auto before = static_cast<std::uint64_t>(std::ceil(std::clamp(share, 0.0, 1.0) * static_cast<double>(size_ - 1)));
  if (before == size_ - 1) return largest_;
  for (const auto& [value, count] : counts_) {
    if (before < count) return value;
    before -= count;
  }
  return largest_;
}

std::uint64_t ValueCounts::CountUpTo(double limit) const {
  std::uint64_t sum = 0;
  for (const auto& [value, count] : counts_) {
    if (value > limit) break;
    sum += count;
  }
  return sum;
}

}  // namespace terrace::fly
