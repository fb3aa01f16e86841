// The bounding box of a triangle, and its samples in each row. Compiled once for each instruction set; part of
// triangle_scan.cc.
#if defined(TERRACE_ENGINE_TIN_SPAN_FINDER_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TERRACE_ENGINE_TIN_SPAN_FINDER_INL_H_
#undef TERRACE_ENGINE_TIN_SPAN_FINDER_INL_H_
#else
#define TERRACE_ENGINE_TIN_SPAN_FINDER_INL_H_
#endif

#include <hwy/highway.h>

#include <array>
#include <cstddef>
#include <cstdint>

#include "engine/tin/scan/furthest-inl.h"

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

// The position of a triangle, relative to its last corner p.
struct TriangleBox {
  int px, py;
  int ux, uy, vx, vy;
  int west, east, south, north;  // bounding box without the field's border
};

// First or last columns of up to kRows rows, with padding for whole vectors.
constexpr int kRows = 64;
using Columns = std::array<std::int32_t, kRows + 16>;

// The exact spans of a triangle. Relative to p, an edge crosses row y at x = n / dy with an integer n = x0 dy + (y -
// y0) dx, rounded up on the west side, down on the east. In single precision, where extents are at most 2^11, n is at
// most 2^23 and so exact; the float nearest to a quotient of at most 2^11 is less than 2^-12 from it, and a quotient
// that is not an integer is at least 2^-11 from the next. In double the same holds of extents up to 2^16. A triangle is
// convex: of two lines on one side the nearer one bounds the row, so lines need not end at corners. Beyond its edge a
// line's quotient may be larger and rounded, but it stays the farther one.
template <typename Tag>
class SpanFinder {
 public:
  using Number = hn::TFromD<Tag>;

  HWY_INLINE explicit SpanFinder(const TriangleBox& t) : px_(t.px), first_(t.px + t.west), last_(t.px + t.east) {
    const Number xs[4] = {0, static_cast<Number>(t.ux), static_cast<Number>(t.vx), 0};
    const Number ys[4] = {0, static_cast<Number>(t.uy), static_cast<Number>(t.vy), 0};
    std::size_t easts = 0, wests = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      // Counter-clockwise edges run up on the east side and down on the west side. No branches: they would be
      // mispredicted.
      const Number dx = xs[i + 1] - xs[i], dy = ys[i + 1] - ys[i], n = xs[i] * dy - ys[i] * dx;
      east_[easts] = {dx, dy, n};
      west_[wests] = {-dx, -dy, -n};
      easts += dy > 0 ? 1 : 0;
      wests += dy < 0 ? 1 : 0;
    }
    east_[easts] = east_[0];
    west_[wests] = west_[0];
  }

  // Finds the spans of `rows` rows from `first_row` on, relative to p. Columns are those of the field, without its
  // border.
  HWY_INLINE void Find(int first_row, int rows, Columns& firsts, Columns& lasts) const {
    constexpr Tag tag;
    constexpr hn::Rebind<std::int32_t, Tag> ints;
    const auto p = All(ints, px_), least = All(ints, first_), most = All(ints, last_);
    for (int j = 0; j < rows; j += LanesOf<Tag>()) {
      const auto y = From(tag, first_row + j);
      const auto first = hn::Max(hn::Ceil(At(west_[0], y)), hn::Ceil(At(west_[1], y)));
      const auto last = hn::Min(hn::Floor(At(east_[0], y)), hn::Floor(At(east_[1], y)));
      hn::StoreU(hn::Max(hn::Add(p, ToInts(first)), least), ints, firsts.data() + j);
      hn::StoreU(hn::Min(hn::Add(p, ToInts(last)), most), ints, lasts.data() + j);
    }
  }

 private:
  struct Line {
    Number dx, dy, n;
  };
  static HWY_INLINE hn::Vec<Tag> At(const Line& line, hn::Vec<Tag> y) {
    constexpr Tag tag;
    return hn::Div(hn::MulAdd(y, All(tag, line.dx), All(tag, line.n)), All(tag, line.dy));
  }
  static HWY_INLINE auto ToInts(hn::Vec<Tag> x) {
    constexpr hn::Rebind<std::int32_t, Tag> ints;
    if constexpr (sizeof(Number) == sizeof(float)) {
      return hn::ConvertTo(ints, x);
    } else {
      return hn::DemoteTo(ints, x);
    }
  }

  int px_, first_, last_;
  Line east_[4], west_[4];
};

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
