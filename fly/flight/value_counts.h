// Percentiles of any number of values in bounded memory.
#pragma once

#include <cstdint>
#include <map>

namespace terrace::fly {

// How often each value occurred. Values keep 12 significant bits: at most about 65,000 different ones lie between a
// microsecond and an hour, or between a thousandth of a pixel and 10,000 pixels.
class ValueCounts {
 public:
  // `value`: not negative; infinity is allowed.
  void Add(double value, std::uint64_t times = 1);
  // Adds the values of `other` that are above `limit`.
  void AddAbove(double limit, const ValueCounts& other);

  std::uint64_t size() const { return size_; }
  // The value with index ceil(share * (n - 1)) of the n values in ascending order, 0 <= share <= 1; 0 without values.
  // Relative error below 2^-11; share 1 is exact in single precision.
  double Percentile(double share) const;
  // The number of values of at most `limit`; values that differ from it by less than 2^-11 of it may count or not.
  std::uint64_t CountUpTo(double limit) const;

 private:
  std::map<float, std::uint64_t> counts_;
  std::uint64_t size_ = 0;
  float largest_ = 0;
};

}  // namespace terrace::fly
