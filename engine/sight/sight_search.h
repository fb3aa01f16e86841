// The search for the smallest clearance of a ray, and for the first place where it is blocked.
#pragma once

#include <algorithm>
#include <limits>

#include "engine/sight/sight_ray.h"

namespace terrace::dem {

// What is known of a ray so far.
class SightSearch {
 public:
  // Whether a part of the ray that begins at `start` and has at least this clearance can be skipped.
  bool IsSettled(double clearance_m, double start) const {
    return clearance_m >= clearance_m_ && (clearance_m >= -kSightTolerance || start >= blocked_at_);
  }
  // A clearance of the ray at a share of its length.
  void Add(double clearance_m, double at) {
    if (clearance_m < clearance_m_) clearance_m_ = clearance_m, clearance_at_ = at;
  }
  void AddBlocked(double at) { blocked_at_ = std::min(blocked_at_, at); }
  bool IsBlockedBefore(double at) const { return blocked_at_ <= at; }
  SightAnswer Answer(bool has_gaps) const;

 private:
  static constexpr double kNone = std::numeric_limits<double>::infinity();
  double clearance_m_ = kNone, clearance_at_ = 0, blocked_at_ = kNone;
};

}  // namespace terrace::dem
