// The total squared error of a triangulation, updated while triangles change. For the root-mean-square goal.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace terrace::tin {

// Neumaier's compensated summation: the sum does not drift over millions of additions and subtractions, so that the
// total depends on the present triangles and not on earlier ones.
class CompensatedSum {
 public:
  void Add(double value) {
    const double sum = sum_ + value;
    lost_ += std::abs(sum_) >= std::abs(value) ? (sum_ - sum) + value : (value - sum) + sum_;
    sum_ = sum;
  }
  double Total() const { return sum_ + lost_; }

 private:
  double sum_ = 0;
  double lost_ = 0;
};

class SquaredErrors {
 public:
  // Slots that were never set count zero.
  void Set(std::uint32_t slot, double squares) {
    if (slot >= by_slot_.size()) by_slot_.resize(slot + std::size_t{1}, 0.0);
    total_.Add(squares);
    total_.Add(-by_slot_[slot]);
    by_slot_[slot] = squares;
  }
  double Total() const { return total_.Total(); }

 private:
  std::vector<double> by_slot_;
  CompensatedSum total_;
};

}  // namespace terrace::tin
