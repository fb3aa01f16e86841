#include "engine/tin/mesh/candidate_queue.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <span>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/mesh/candidate_queue.cc"
#include <hwy/contrib/sort/vqsort.h>
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kMaxLanes = 16;

}  // namespace

// `count` is a multiple of kBlock: the arrays are padded with zeros.
float Largest(const float* errors, std::size_t count) {
  const hn::ScalableTag<float> floats;
  const std::size_t lanes = hn::Lanes(floats);
  auto most = hn::Zero(floats), also = hn::Zero(floats);
  for (std::size_t i = 0; i < count; i += 2 * lanes) {
    most = hn::Max(most, hn::LoadU(floats, errors + i));
    also = hn::Max(also, hn::LoadU(floats, errors + i + lanes));
  }
  return hn::GetLane(hn::MaxOfLanes(floats, hn::Max(most, also)));
}

// Sorts distinct words into `sorted`, the largest first: the rank of a word is the number of larger ones. Reads up to a
// vector beyond the words.
void SortFew(const std::uint64_t* words, std::size_t count, std::uint64_t* sorted) {
  const hn::CappedTag<std::uint64_t, kMaxLanes> tag;
  const std::size_t lanes = hn::Lanes(tag);
  HWY_ALIGN std::array<std::uint64_t, kMaxLanes> places;
  for (std::size_t first = 0; first < count; first += lanes) {
    const auto block = hn::LoadU(tag, words + first);
    auto larger = hn::Zero(tag);
    for (std::size_t k = 0; k < count; ++k) {
      larger = hn::Sub(larger, hn::VecFromMask(tag, hn::Gt(hn::Set(tag, words[k]), block)));
    }
    hn::Store(larger, tag, places.data());
    for (std::size_t i = 0; i < std::min(lanes, count - first); ++i) sorted[places[i]] = words[first + i];
  }
}

// Writes the indices of errors at or above the threshold, ascending, and up to a vector beyond; returns how many.
#if HWY_TARGET <= HWY_AVX3
// Without branches if the processor has an instruction for it: about one in a hundred errors qualifies, at random
// positions.
std::size_t Sweep(const float* errors, std::size_t count, float threshold, std::uint32_t* found) {
  const hn::CappedTag<float, kMaxLanes> floats;
  const hn::RebindToUnsigned<decltype(floats)> slots;
  const std::size_t lanes = hn::Lanes(floats);
  const auto least = hn::Set(floats, threshold);
  const auto next = hn::Set(slots, static_cast<std::uint32_t>(lanes));
  auto slot = hn::Iota(slots, 0);
  std::size_t n = 0;
  const auto find = [&](std::size_t i) HWY_ATTR {
    const auto is_foremost = hn::RebindMask(slots, hn::Ge(hn::LoadU(floats, errors + i), least));
    hn::StoreU(hn::Compress(slot, is_foremost), slots, found + n);
    n += hn::CountTrue(slots, is_foremost);
    slot = hn::Add(slot, next);
  };
  for (std::size_t i = 0; i < count; i += 2 * lanes) {
    find(i);
    find(i + lanes);
  }
  return n;
}
#else
std::size_t Sweep(const float* errors, std::size_t count, float threshold, std::uint32_t* found) {
  const hn::CappedTag<float, kMaxLanes> floats;
  const std::size_t lanes = hn::Lanes(floats);
  const auto least = hn::Set(floats, threshold);
  std::size_t n = 0;
  for (std::size_t i = 0; i < count; i += 2 * lanes) {
    const auto low = hn::LoadU(floats, errors + i), high = hn::LoadU(floats, errors + i + lanes);
    if (hn::AllFalse(floats, hn::Ge(hn::Max(low, high), least))) continue;
    for (std::size_t k = i; k < i + 2 * lanes; ++k) {
      found[n] = static_cast<std::uint32_t>(k);
      n += errors[k] >= threshold ? 1 : 0;
    }
  }
  return n;
}
#endif

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {
namespace {

HWY_EXPORT(Largest);
HWY_EXPORT(SortFew);
HWY_EXPORT(Sweep);

constexpr std::size_t kBlock = 64;    // slots: two vectors of the largest width
constexpr std::size_t kSwept = 4096;  // slots swept in one go
constexpr std::size_t kBeyond = 16;   // a vector of the largest width: written beyond a sweep, read beyond words
constexpr std::size_t kAhead = 8;     // entries: how early slots are prefetched
constexpr std::ptrdiff_t kNear = 8;   // entries looked at one by one
constexpr std::size_t kRoom = 32;     // entries that fit before those that a sweep found
constexpr std::size_t kFew = 64;      // words: hwy::Sorter asks the system for random numbers, however few there are

}  // namespace

CandidateQueue::CandidateQueue(std::size_t likely_slots) : threshold_(std::numeric_limits<float>::infinity()) {
  errors_.reserve(likely_slots);
  samples_.reserve(likely_slots);
}

std::uint32_t CandidateQueue::Winner() {
  do {
    for (; run_begin_ < run_.size(); ++run_begin_) {
      const Entry& entry = run_[run_begin_];
      if (run_begin_ + kAhead < run_.size()) {
        const std::uint32_t ahead = run_[run_begin_ + kAhead].slot;
        __builtin_prefetch(&errors_[ahead]);
        __builtin_prefetch(&samples_[ahead]);
      }
      if (OrderOf(entry.slot) == entry.order) return entry.slot;
    }
  } while (Refill());
  return kNoSlot;
}

bool CandidateQueue::Refill() {
  if (entered_ > 2 * wanted_) step_ = std::sqrt(step_);
  if (entered_ < wanted_ / 2) step_ = std::max(step_ * step_, 0.25);
  // A sweep costs about a cycle per 16 slots; inserting an entry costs about a cycle per few entries behind it.
  wanted_ = std::max(kMinWanted, static_cast<std::size_t>(3 * std::sqrt(static_cast<double>(errors_.size()))));
  entered_ = 0;
  // The remaining candidates are below the threshold, usually just below.
  if (SweepFrom(threshold_)) return true;
  const float largest = HWY_DYNAMIC_DISPATCH(Largest)(errors_.data(), errors_.size());
  if (SweepFrom(std::min(largest, std::numeric_limits<float>::max()))) return true;
  threshold_ = std::numeric_limits<float>::denorm_min();
  return false;
}

// Fills the run with all candidates that are not much smaller than `max_error`; false if there are none.
bool CandidateQueue::SweepFrom(float max_error) {
  run_.clear();
  run_begin_ = 0;
  if (!(max_error > 0) || std::isinf(max_error)) return false;
  threshold_ = std::max(static_cast<float>(max_error * step_), std::numeric_limits<float>::denorm_min());
  swept_.clear();
  std::array<std::uint32_t, kSwept + kBeyond> found;
  for (std::size_t first = 0; first < errors_.size(); first += kSwept) {
    const std::size_t slots = std::min(kSwept, errors_.size() - first);
    const std::size_t count = HWY_DYNAMIC_DISPATCH(Sweep)(errors_.data() + first, slots, threshold_, found.data());
    for (std::size_t i = 0; i < count; ++i) swept_.push_back(static_cast<std::uint32_t>(first) + found[i]);
  }
  if (swept_.empty()) return false;
  run_.resize(kRoom);
  run_begin_ = kRoom;
  SortSwept();
  entered_ = swept_.size();
  return true;
}

// Appends the swept slots to the run. If errors are close to each other, an error, a sample of a tile and the index of
// a swept slot fit into one word, and a vector has twice as many words as pairs.
void CandidateQueue::SortSwept() {
  const std::uint32_t least = std::bit_cast<std::uint32_t>(threshold_);
  std::uint32_t beyond = 0, samples = 0;
  for (const std::uint32_t slot : swept_) {
    beyond |= std::bit_cast<std::uint32_t>(errors_[slot]) - least;
    samples |= samples_[slot];
  }
  const auto place_bits = static_cast<unsigned>(std::bit_width(swept_.size() - 1));
  const auto sample_bits = static_cast<unsigned>(std::bit_width(samples)), bits = place_bits + sample_bits;
  if (bits + static_cast<unsigned>(std::bit_width(beyond)) > 64) return SortPairs();
  const std::uint64_t place_mask = (std::uint64_t{1} << place_bits) - 1;
  const std::uint64_t sample_mask = (std::uint64_t{1} << sample_bits) - 1;
  words_.resize(swept_.size() + kBeyond);
  for (std::size_t i = 0; i < swept_.size(); ++i) {
    const std::uint64_t error = std::bit_cast<std::uint32_t>(errors_[swept_[i]]) - least;
    words_[i] = error << bits | (~std::uint64_t{samples_[swept_[i]]} & sample_mask) << place_bits | i;
  }
  std::array<std::uint64_t, kFew> few;
  std::span<const std::uint64_t> sorted(words_.data(), swept_.size());
  if (sorted.size() <= kFew) {
    HWY_DYNAMIC_DISPATCH(SortFew)(words_.data(), sorted.size(), few.data());
    sorted = {few.data(), sorted.size()};
  } else {
    hwy::Sorter()(words_.data(), sorted.size(), hwy::SortDescending());
  }
  for (const std::uint64_t word : sorted) {
    const std::uint64_t sample = ~(word >> place_bits) & sample_mask;
    run_.push_back({(least + (word >> bits)) << 32 | (sample ^ 0xFFFFFFFF), swept_[word & place_mask]});
  }
}

void CandidateQueue::SortPairs() {
  std::vector<hwy::uint128_t> pairs;
  pairs.reserve(swept_.size());
  for (const std::uint32_t slot : swept_) pairs.push_back({slot, OrderOf(slot)});
  hwy::Sorter()(pairs.data(), pairs.size(), hwy::SortDescending());
  for (const hwy::uint128_t& pair : pairs) run_.push_back({pair.hi, static_cast<std::uint32_t>(pair.lo)});
}

void CandidateQueue::Insert(std::uint32_t slot) {
  const Entry entry{OrderOf(slot), slot};
  const auto precedes = [&](const Entry& other) { return other.order > entry.order; };
  // Two in three entries become the first, nine in ten are among the first few.
  const auto front = run_.begin() + static_cast<std::ptrdiff_t>(run_begin_);
  const auto near = front + std::min<std::ptrdiff_t>(run_.end() - front, kNear);
  auto place = std::find_if_not(front, near, precedes);
  if (place == near) place = std::partition_point(near, run_.end(), precedes);
  while (place != run_.end() && place->order == entry.order && place->slot > entry.slot) ++place;
  if (run_begin_ > 0 && place - front < run_.end() - place) {
    std::copy(front, place, front - 1);
    --run_begin_;
    *(place - 1) = entry;
  } else {
    run_.insert(place, entry);
  }
  ++entered_;
  if (run_.size() - run_begin_ > 4 * wanted_) Shorten();
}

// Drops the last half. Equal errors must stay or go together, because only the threshold separates them. If heights are
// whole metres, all errors of the last half may be equal: finding their beginning must not take linear time.
void CandidateQueue::Shorten() {
  const auto error_of = [](const Entry& entry) { return static_cast<std::uint32_t>(entry.order >> 32); };
  const std::uint32_t least = error_of(run_[run_begin_ + 2 * wanted_ - 1]);
  if (error_of(run_.back()) == least) return;
  const auto end = std::partition_point(run_.begin() + static_cast<std::ptrdiff_t>(run_begin_), run_.end(),
                                        [&](const Entry& entry) { return error_of(entry) >= least; });
  run_.erase(end, run_.end());
  threshold_ = std::bit_cast<float>(least);
}

void CandidateQueue::Grow(std::size_t slots) {
  const std::size_t padded = (slots + kBlock - 1) / kBlock * kBlock;
  errors_.GrowTo(padded, 0.0F);
  samples_.GrowTo(padded, kNoSample);
}

}  // namespace terrace::tin
#endif
