#include "engine/tin/live_triangles.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/live_triangles.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

using Index = InsertionRecord::Index;

// Stars of up to eight triangles, which are nearly all, take one step without branches, which would be mispredicted.
using Corners = hn::CappedTag<std::uint32_t, 8>;

HWY_INLINE hn::Vec<Corners> LoadIndices(const Index* from) {
  return hn::PromoteTo(Corners(), hn::LoadU(hn::Rebind<Index, Corners>(), from));
}

}  // namespace

// Writes to `triangles`, and up to a vector beyond; returns the number of triangles that exist.
std::size_t CollectStanding(const InsertionRecord& record, std::size_t insertions,
                            std::array<std::uint32_t, 3>* triangles) {
  const Corners corners;
  const std::size_t lanes = hn::Lanes(corners);
  const auto lane = hn::Iota(corners, 0), now = hn::Set(corners, static_cast<std::uint32_t>(insertions));
  auto* out = triangles;
  const Index *removed = record.removed.data(), *ring = record.rings.data();
  const Index *const removed_end = removed + record.removed.size(), *const rings_end = ring + record.rings.size();
  const auto emit = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    *out = {a, b, c};
    out += *removed++ >= insertions ? 1 : 0;
  };
  emit(0, 1, 2);
  emit(2, 3, 0);
  for (std::size_t i = 0; i < insertions; ++i) {
    const bool is_open = (record.sizes[i] & InsertionRecord::kOpen) != 0;
    const std::size_t count = record.sizes[i] & static_cast<Index>(~InsertionRecord::kOpen);
    const auto centre = static_cast<std::uint32_t>(4 + i);
    const std::uint32_t last = ring[is_open ? count : 0];
    for (std::size_t k = 0; k < count; k += lanes) {
      const std::size_t left = count - k;
      if (static_cast<std::size_t>(rings_end - ring) <= k + lanes ||
          static_cast<std::size_t>(removed_end - removed) < lanes) {
        const std::size_t end = std::min(count, k + lanes);
        for (std::size_t t = k; t < end; ++t) emit(ring[t], t + 1 == count ? last : ring[t + 1], centre);
        continue;
      }
      const auto is_last = hn::Eq(lane, hn::Set(corners, static_cast<std::uint32_t>(left - 1)));
      const auto from = LoadIndices(ring + k);
      const auto to = hn::IfThenElse(is_last, hn::Set(corners, last), LoadIndices(ring + k + 1));
      const auto is_gone = hn::Lt(LoadIndices(removed), now);
      const auto stands = hn::AndNot(is_gone, hn::Lt(lane, hn::Set(corners, static_cast<std::uint32_t>(left))));
      hn::StoreInterleaved3(hn::Compress(from, stands), hn::Compress(to, stands), hn::Set(corners, centre), corners,
                            out->data());
      out += hn::CountTrue(corners, stands);
      removed += std::min(left, lanes);
    }
    ring += count + (is_open ? 1 : 0);
  }
  return static_cast<std::size_t>(out - triangles);
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {
namespace {

HWY_EXPORT(CollectStanding);

}  // namespace

// A triangulation of v vertices has fewer than 2 v triangles; the rest is padding for writes beyond the last.
std::vector<std::array<std::uint32_t, 3>> LiveTriangles(const InsertionRecord& record, std::size_t insertions) {
  constexpr std::size_t kMaxLanes = 8;
  std::vector<std::array<std::uint32_t, 3>> triangles(2 * (insertions + 4) + kMaxLanes);
  triangles.resize(HWY_DYNAMIC_DISPATCH(CollectStanding)(record, insertions, triangles.data()));
  return triangles;
}

}  // namespace terrace::tin
#endif
