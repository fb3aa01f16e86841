#include "engine/tin/triangle_scan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/triangle_scan.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Everything is evaluated in one of two precisions. Single is as good as double for most triangles: all heights are
// multiples of a quantum (OpenSamples::quantum), so all numbers that the formula adds and multiplies are, and every
// multiple up to 2^24 times the quantum is a float. Where that may be exceeded, it is double.
using DoublesTag = hn::CappedTag<double, 16>;
using FloatsTag = hn::CappedTag<float, 16>;
constexpr DoublesTag kDoubles;
constexpr FloatsTag kFloats;
using Floats = hn::Vec<FloatsTag>;

// Row-major indices: in doubles beside doubles, in integers beside floats, which cannot hold them.
template <typename Tag>
using IndexTag = std::conditional_t<std::is_same_v<hn::TFromD<Tag>, float>, hn::RebindToSigned<Tag>, Tag>;

template <typename Tag>
HWY_INLINE int LanesOf() {
  return static_cast<int>(hn::Lanes(Tag()));
}
template <typename Tag, typename Value>
HWY_INLINE hn::Vec<Tag> All(Tag tag, Value value) {
  return hn::Set(tag, static_cast<hn::TFromD<Tag>>(value));
}

// The numbers of the lanes, from memory: hn::Iota counts them anew each time, in a loop.
template <typename T>
struct LaneNumbers {
  HWY_ALIGN static constexpr T kValues[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
};
template <typename Tag>
HWY_INLINE hn::Vec<Tag> From(Tag tag, int first) {
  static_assert(hn::MaxLanes(Tag()) <= 16);
  return hn::Add(All(tag, first), hn::Load(tag, LaneNumbers<hn::TFromD<Tag>>::kValues));
}

// One triangle, seen from its last corner p; its plane in one of the precisions.
template <typename Number>
struct TrianglePlane {
  int px, py;
  int ux, uy, vx, vy;
  int west, east, south, north;  // bounding box
  Number pz;
  Number d, a, b;  // D, A and B of the header
};
using ExactPlane = TrianglePlane<double>;
using SinglePlane = TrianglePlane<float>;

// The precision of samples that are visited.
template <typename Found>
using PlaneFor = TrianglePlane<hn::TFromD<typename Found::Tag>>;

// The larger or the smaller one; b where one is NaN.
HWY_INLINE Floats MaxOrSecond(Floats a, Floats b) {
#if HWY_ARCH_X86
  return hn::Max(a, b);  // the instruction does just that
#else
  return hn::IfThenElse(hn::Gt(a, b), a, b);
#endif
}
HWY_INLINE Floats MinOrSecond(Floats a, Floats b) {
#if HWY_ARCH_X86
  return hn::Min(a, b);
#else
  return hn::IfThenElse(hn::Lt(a, b), a, b);
#endif
}

// The furthest sample so far, lane by lane. Each lane meets its samples in row-major order, so that ">" keeps the
// first; no comparison with NaN holds.
template <typename TagOfNumerators>
class Furthest {
 public:
  using Tag = TagOfNumerators;
  using Index = hn::Vec<IndexTag<Tag>>;

  HWY_INLINE Furthest() : numerator_(All(kTag, -1)), index_(hn::Zero(kIndices)) {}

  HWY_INLINE void Visit(hn::Vec<Tag> numerator, Index index, hn::Mask<Tag> inside) {
    Keep(hn::And(inside, hn::Gt(numerator, numerator_)), numerator, index);
  }
  HWY_INLINE void Visit(hn::Vec<Tag> numerator, Index index) {
    const auto is_further = hn::Gt(numerator, numerator_);
    if constexpr (std::is_same_v<Tag, FloatsTag>) {
      numerator_ = MaxOrSecond(numerator, numerator_);  // the next sample waits for this one, and not for the mask
    } else {
      numerator_ = hn::IfThenElse(is_further, numerator, numerator_);
    }
    index_ = hn::IfThenElse(hn::RebindMask(kIndices, is_further), index, index_);
  }

  // Of samples that were visited apart.
  HWY_INLINE void Merge(const Furthest& other) {
    const auto tied = hn::And(hn::Eq(other.numerator_, numerator_), hn::RebindMask(kTag, hn::Lt(other.index_, index_)));
    Keep(hn::Or(hn::Gt(other.numerator_, numerator_), tied), other.numerator_, other.index_);
  }

  HWY_INLINE hn::Vec<Tag> numerators() const { return numerator_; }
  HWY_INLINE Index indices() const { return index_; }
  HWY_INLINE hn::TFromD<Tag> numerator() const { return hn::GetLane(hn::MaxOfLanes(kTag, numerator_)); }

  // Precondition: some sample was visited.
  HWY_INLINE std::uint32_t sample() const {
    const auto foremost = hn::RebindMask(kIndices, hn::Eq(numerator_, hn::MaxOfLanes(kTag, numerator_)));
    const Index none = All(kIndices, std::numeric_limits<std::int32_t>::max());
    const auto first = hn::GetLane(hn::MinOfLanes(kIndices, hn::IfThenElse(foremost, index_, none)));
    return static_cast<std::uint32_t>(static_cast<std::int64_t>(first));
  }

 private:
  static constexpr Tag kTag{};
  static constexpr IndexTag<Tag> kIndices{};

  HWY_INLINE void Keep(hn::Mask<Tag> which, hn::Vec<Tag> numerator, Index index) {
    numerator_ = hn::IfThenElse(which, numerator, numerator_);
    index_ = hn::IfThenElse(hn::RebindMask(kIndices, which), index, index_);
  }

  hn::Vec<Tag> numerator_;  // D times the distance
  Index index_;             // row-major
};

// Whether sums are exact where it is used: planes may be stepped then.
template <typename Found>
inline constexpr bool kIsExact = std::is_same_v<Found, Furthest<FloatsTag>>;

// The same where single precision leaves doubts: also how close to a lane's furthest sample another one of it comes.
class FurthestTwo {
 public:
  using Tag = FloatsTag;
  using Index = Furthest<FloatsTag>::Index;

  HWY_INLINE FurthestTwo() : runner_up_(All(kFloats, -1)) {}

  HWY_INLINE void Visit(Floats numerator, Index index, hn::Mask<FloatsTag> inside) {
    Visit(hn::IfThenElse(inside, numerator, All(kFloats, -1)), index);
  }
  HWY_INLINE void Visit(Floats numerator, Index index) {
    runner_up_ = MaxOrSecond(MinOrSecond(furthest_.numerators(), numerator), runner_up_);
    furthest_.Visit(numerator, index);
  }
  HWY_INLINE void Merge(const FurthestTwo& other) {
    runner_up_ =
        hn::Max(hn::Max(runner_up_, other.runner_up_), hn::Min(furthest_.numerators(), other.furthest_.numerators()));
    furthest_.Merge(other.furthest_);
  }

  HWY_INLINE float numerator() const { return furthest_.numerator(); }
  HWY_INLINE float runner_up() const { return hn::GetLane(hn::MaxOfLanes(kFloats, runner_up_)); }
  HWY_INLINE const Furthest<FloatsTag>& furthest() const { return furthest_; }

 private:
  Furthest<FloatsTag> furthest_;
  Floats runner_up_;
};

HWY_INLINE hn::Vec<DoublesTag> HeightsAt(DoublesTag tag, const float* from) {
  return hn::PromoteTo(tag, hn::LoadU(hn::Rebind<float, DoublesTag>(), from));
}

// Barycentric coordinates times D of samples relative to p: integers, exact, also when stepped from row to row. Inside
// and on the edges none is negative.
class Barycentric {
 public:
  using Doubles = hn::Vec<DoublesTag>;

  HWY_INLINE Barycentric(const ExactPlane& t, Doubles x, Doubles y)
      : step_u_(All(kDoubles, 2 * t.vx)),
        step_v_(All(kDoubles, 2 * t.ux)),
        step_p_(hn::Sub(step_u_, step_v_)),
        of_u_(hn::Sub(hn::Mul(All(kDoubles, t.vy), x), hn::Mul(All(kDoubles, t.vx), y))),
        of_v_(hn::Sub(hn::Mul(All(kDoubles, t.ux), y), hn::Mul(All(kDoubles, t.uy), x))),
        of_p_(hn::Sub(All(kDoubles, t.d), hn::Add(of_u_, of_v_))) {}

  HWY_INLINE hn::Mask<DoublesTag> IsInside() const {
    return hn::Ge(hn::Min(hn::Min(of_u_, of_v_), of_p_), hn::Zero(kDoubles));
  }
  // Two rows on.
  HWY_INLINE void Step() {
    of_u_ = hn::Sub(of_u_, step_u_);
    of_v_ = hn::Add(of_v_, step_v_);
    of_p_ = hn::Add(of_p_, step_p_);
  }

 private:
  Doubles step_u_, step_v_, step_p_;
  Doubles of_u_, of_v_, of_p_;
};

// D times the distance of a vector of samples.
template <typename V>
HWY_INLINE V Numerator(V heights, V pz, V d, V plane) {
  return hn::Abs(hn::Sub(hn::Mul(d, hn::Sub(heights, pz)), plane));
}

// The same in single precision, whose sign does not matter and whose load is part of the subtraction that way round.
// Fused where there are such operations: what is exact is exact either way, and where there are doubts they become
// smaller.
HWY_INLINE Floats NumeratorFrom(const float* heights, Floats pz, Floats d, Floats plane) {
  return hn::Abs(hn::MulAdd(d, hn::Sub(pz, hn::LoadU(kFloats, heights)), plane));
}

// All bits where one of the barycentric coordinates has a sign: NaN, which no comparison holds for. No zero has one: on
// the way from the corner of a box that holds the triangle, two zeros with a sign never meet.
HWY_INLINE Floats NaNWhereNegative(Floats a, Floats b, Floats c) {
  const IndexTag<FloatsTag> ints;
  return hn::BitCast(kFloats, hn::ShiftRight<31>(hn::BitCast(ints, hn::Or3(a, b, c))));
}

// Every sample of some columns of the bounding box, in single precision: no spans, no divisions, no branches but the
// loop. Barycentric coordinates are integers, whose signs make what is outside NaN.
template <typename Found>
HWY_INLINE Found ScanColumnsInSingle(const OpenSamples& samples, const SinglePlane& t, int column) {
  constexpr IndexTag<FloatsTag> ints;
  const Floats d = All(kFloats, t.d), pz = All(kFloats, t.pz), b = All(kFloats, t.b), one = All(kFloats, 1);
  const Floats a_x = hn::Mul(All(kFloats, t.a), From(kFloats, column));
  Floats y = All(kFloats, t.south);
  const auto x = From(ints, column);
  auto of_u = hn::Sub(hn::Mul(All(ints, t.vy), x), All(ints, t.vx * t.south));
  auto of_v = hn::Sub(All(ints, t.ux * t.south), hn::Mul(All(ints, t.uy), x));
  auto of_p = hn::Sub(All(ints, t.ux * t.vy - t.uy * t.vx), hn::Add(of_u, of_v));
  const auto step_u = All(ints, t.vx), step_v = All(ints, t.ux), step_p = All(ints, t.vx - t.ux);
  const int width = samples.width(), stride = samples.stride(), first_row = t.py + t.south;
  const float* from = samples.Row(first_row) + t.px + column;
  auto index = From(ints, first_row * width + t.px + column);
  const auto next_row = All(ints, width);
  Floats plane = hn::MulAdd(b, y, a_x);
  Found furthest;
  for (int j = t.south; j <= t.north; ++j) {
    const Floats numerator = NumeratorFrom(from, pz, d, plane);
    const auto outside = hn::ShiftRight<31>(hn::Or3(of_u, of_v, of_p));
    furthest.Visit(hn::Or(numerator, hn::BitCast(kFloats, outside)), index);
    from += stride;
    if constexpr (kIsExact<Found>) {
      plane = hn::Add(plane, b);
    } else {
      y = hn::Add(y, one);
      plane = hn::MulAdd(b, y, a_x);
    }
    index = hn::Add(index, next_row);
    of_u = hn::Sub(of_u, step_u);
    of_v = hn::Add(of_v, step_v);
    of_p = hn::Add(of_p, step_p);
  }
  return furthest;
}

// The same in double, two rows at a time, each for itself, since what is furthest so far is waited for. The row above
// the last one may be looked at: it is outside.
HWY_INLINE Furthest<DoublesTag> ScanColumnsInDouble(const OpenSamples& samples, const ExactPlane& t, int column) {
  constexpr DoublesTag tag;
  constexpr IndexTag<DoublesTag> indices;
  const auto d = All(tag, t.d), pz = All(tag, t.pz), b = All(tag, t.b), one = All(tag, 1), two = All(tag, 2);
  const auto x = From(tag, column), a_x = hn::Mul(All(tag, t.a), x);
  auto y = All(tag, t.south), above = hn::Add(y, one);
  Barycentric even(t, x, y), odd(t, x, above);
  const int width = samples.width(), stride = samples.stride(), first_row = t.py + t.south;
  const float* from = samples.Row(first_row) + t.px + column;
  const auto next_row = All(indices, width);
  auto index = From(indices, first_row * width + t.px + column);
  Furthest<DoublesTag> furthest, also;
  for (int j = t.south; j <= t.north; j += 2) {
    furthest.Visit(Numerator(HeightsAt(tag, from), pz, d, hn::Add(a_x, hn::Mul(b, y))), index, even.IsInside());
    index = hn::Add(index, next_row);
    also.Visit(Numerator(HeightsAt(tag, from + stride), pz, d, hn::Add(a_x, hn::Mul(b, above))), index, odd.IsInside());
    index = hn::Add(index, next_row);
    from += 2 * stride;
    y = hn::Add(y, two);
    above = hn::Add(above, two);
    even.Step();
    odd.Step();
  }
  furthest.Merge(also);
  return furthest;
}

template <typename Found>
HWY_INLINE Found ScanColumns(const OpenSamples& samples, const PlaneFor<Found>& t, int column) {
  if constexpr (std::is_same_v<typename Found::Tag, FloatsTag>) {
    return ScanColumnsInSingle<Found>(samples, t, column);
  } else {
    return ScanColumnsInDouble(samples, t, column);
  }
}

template <typename Found>
HWY_INLINE Found ScanBox(const OpenSamples& samples, const PlaneFor<Found>& t) {
  const int lanes = LanesOf<typename Found::Tag>();
  Found furthest = ScanColumns<Found>(samples, t, t.west);
  for (int column = t.west + lanes; column <= t.east; column += lanes) {
    furthest.Merge(ScanColumns<Found>(samples, t, column));
  }
  return furthest;
}

// First or last columns of up to kRows rows, and what whole vectors spill.
constexpr int kRows = 64;
using Columns = std::array<std::int32_t, kRows + 16>;

// The exact spans of a triangle. Relative to p, an edge crosses row y at x = n / dy with an integer n = x0 dy + (y -
// y0) dx, rounded up on the west side, down on the east. In single precision, where extents are at most 2^11, n is at
// most 2^23 and so exact; the float nearest to a quotient of at most 2^11 is less than 2^-12 from it, and a quotient
// that is no integer is at least 2^-11 from the next one. In double the same holds of extents up to 2^16. An outline is
// convex: of two lines on a side the nearer one counts, and neither needs to end. Where one goes on beyond its edge its
// quotient may be larger and rounded, but it stays the further one.
template <typename Tag>
class SpanFinder {
 public:
  using Number = hn::TFromD<Tag>;

  HWY_INLINE explicit SpanFinder(const TrianglePlane<Number>& t) : px_(t.px) {
    const Number xs[4] = {0, static_cast<Number>(t.ux), static_cast<Number>(t.vx), 0};
    const Number ys[4] = {0, static_cast<Number>(t.uy), static_cast<Number>(t.vy), 0};
    std::size_t easts = 0, wests = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      // Counter-clockwise: up on the east side, down on the west. Which edge is which cannot be foretold.
      const Number dx = xs[i + 1] - xs[i], dy = ys[i + 1] - ys[i], n = xs[i] * dy - ys[i] * dx;
      east_[easts] = {dx, dy, n};
      west_[wests] = {-dx, -dy, -n};
      easts += dy > 0 ? 1 : 0;
      wests += dy < 0 ? 1 : 0;
    }
    east_[easts] = east_[0];
    west_[wests] = west_[0];
  }

  // Of some rows from `first_row` on, relative to p; columns are those of the field.
  HWY_INLINE void Find(int first_row, int rows, Columns& firsts, Columns& lasts) const {
    constexpr Tag tag;
    constexpr hn::Rebind<std::int32_t, Tag> ints;
    const auto p = All(ints, px_);
    for (int j = 0; j < rows; j += LanesOf<Tag>()) {
      const auto y = From(tag, first_row + j);
      const auto first = hn::Max(hn::Ceil(At(west_[0], y)), hn::Ceil(At(west_[1], y)));
      const auto last = hn::Min(hn::Floor(At(east_[0], y)), hn::Floor(At(east_[1], y)));
      hn::StoreU(hn::Add(p, ToInts(first)), ints, firsts.data() + j);
      hn::StoreU(hn::Add(p, ToInts(last)), ints, lasts.data() + j);
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

  int px_;
  Line east_[4], west_[4];
};

// Fused in single precision only.
template <typename Found, typename V>
HWY_INLINE V MulAddFor(V a, V b, V c) {
  if constexpr (std::is_same_v<typename Found::Tag, FloatsTag>) {
    return hn::MulAdd(a, b, c);
  } else {
    return hn::Add(hn::Mul(a, b), c);
  }
}

// Row by row, exact spans.
template <typename Found>
HWY_INLINE Found ScanSpans(const OpenSamples& samples, const PlaneFor<Found>& t) {
  using Tag = typename Found::Tag;
  constexpr Tag tag;
  constexpr IndexTag<Tag> indices;
  const auto d = All(tag, t.d), a = All(tag, t.a), b = All(tag, t.b), pz = All(tag, t.pz), one = All(tag, 1);
  const int lanes = LanesOf<Tag>(), last_row = t.py + t.north, width = samples.width();
  const auto lanes_on = All(tag, lanes), none = All(tag, -1);
  [[maybe_unused]] const auto a_on = hn::Mul(a, lanes_on);
  const auto indices_on = All(indices, lanes);
  Found furthest, also, ends;  // apart, since what is furthest so far is waited for
  Columns firsts, lasts;
  const SpanFinder<Tag> finder(t);
  for (int block = t.py + t.south; block <= last_row; block += kRows) {
    const int rows = std::min(kRows, last_row - block + 1);
    finder.Find(block - t.py, rows, firsts, lasts);
    auto y = All(tag, block - t.py);
    for (int j = 0; j < rows; ++j) {
      const int first = firsts[static_cast<std::size_t>(j)], last = lasts[static_cast<std::size_t>(j)], row = block + j;
      const float* from = samples.Row(row) + first;
      const auto b_y = hn::Mul(b, y);
      const auto end = All(indices, row * width + last + 1);
      y = hn::Add(y, one);
      auto x = From(tag, first - t.px);
      auto plane = MulAddFor<Found>(a, x, b_y);
      auto index = From(indices, row * width + first);
      int left = last - first + 1;
      const auto numerator = [&]() HWY_ATTR {
        if constexpr (std::is_same_v<Tag, FloatsTag>) {
          return NumeratorFrom(from, pz, d, plane);
        } else {
          return Numerator(HeightsAt(tag, from), pz, d, plane);
        }
      };
      const auto visit = [&](Found& found) HWY_ATTR {
        found.Visit(numerator(), index);
        from += lanes;
        index = hn::Add(index, indices_on);
        if constexpr (kIsExact<Found>) {
          plane = hn::Add(plane, a_on);
        } else {
          x = hn::Add(x, lanes_on);
          plane = MulAddFor<Found>(a, x, b_y);
        }
      };
      for (; left >= 2 * lanes; left -= 2 * lanes) visit(furthest), visit(also);
      if (left >= lanes) visit(also);
      const auto inside = hn::RebindMask(tag, hn::Lt(index, end));
      ends.Visit(hn::IfThenElse(inside, numerator(), none), index);
    }
  }
  furthest.Merge(also);
  furthest.Merge(ends);
  return furthest;
}

// In double: from the ring, one by one.
HWY_INLINE ExactPlane ExactPlaneOf(const Star& star, std::size_t i) {
  ExactPlane t;
  t.px = star.x, t.py = star.y;
  t.ux = star.ring.dx[i], t.uy = star.ring.dy[i], t.vx = star.ring.dx[i + 1], t.vy = star.ring.dy[i + 1];
  // Two by two: of a list they are found with branches.
  t.west = std::min(std::min(t.ux, t.vx), 0), t.east = std::max(std::max(t.ux, t.vx), 0);
  t.south = std::min(std::min(t.uy, t.vy), 0), t.north = std::max(std::max(t.uy, t.vy), 0);
  t.pz = static_cast<double>(star.height);
  const double ux = t.ux, uy = t.uy, vx = t.vx, vy = t.vy;
  const double uz = static_cast<double>(star.ring.heights[i]) - t.pz;
  const double vz = static_cast<double>(star.ring.heights[i + 1]) - t.pz;
  t.d = ux * vy - uy * vx;
  t.a = vy * uz - uy * vz;
  t.b = ux * vz - vx * uz;
  return t;
}

// Up to so many vectors of columns the box is quicker than its spans.
constexpr int kMostBoxVectors = 3;

template <typename Found>
HWY_INLINE Found ScanWide(const OpenSamples& samples, const PlaneFor<Found>& t) {
  return t.east - t.west < kMostBoxVectors * LanesOf<typename Found::Tag>() ? ScanBox<Found>(samples, t)
                                                                            : ScanSpans<Found>(samples, t);
}

PlaneMisfit ScanExactly(const OpenSamples& samples, const ExactPlane& t) {
  const auto furthest = ScanWide<Furthest<DoublesTag>>(samples, t);
  if (furthest.numerator() < 0) return {};
  return {furthest.numerator() / t.d, furthest.sample()};
}

#if HWY_TARGET != HWY_SCALAR

constexpr hn::RebindToSigned<FloatsTag> kInts;

// Blocks of kSide x kSide samples, a few rows to a vector.
constexpr int kMostLanes = 16;
HWY_ALIGN constexpr float kColumnsBy4[kMostLanes] = {0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3};
HWY_ALIGN constexpr float kRowsBy4[kMostLanes] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3};
HWY_ALIGN constexpr float kColumnsBy8[kMostLanes] = {0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7};
HWY_ALIGN constexpr float kRowsBy8[kMostLanes] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1};

#if HWY_MAX_BYTES >= 32
constexpr int kLargeSide = 8;
#else
constexpr int kLargeSide = 4;
#endif

template <int kSide>
HWY_INLINE Floats RowsFrom(const float* from, int stride) {
  constexpr int kRowsAtOnce = static_cast<int>(hn::MaxLanes(kFloats)) / kSide;
  if constexpr (kRowsAtOnce == 1) {
    static_cast<void>(stride);
    return hn::LoadU(kFloats, from);
  } else if constexpr (kRowsAtOnce == 2) {
    const hn::Half<decltype(kFloats)> row;
    return hn::Combine(kFloats, hn::LoadU(row, from + stride), hn::LoadU(row, from));
  } else {
    const hn::Half<decltype(kFloats)> two;
    const hn::Half<decltype(two)> row;
    return hn::Combine(kFloats, hn::Combine(two, hn::LoadU(row, from + 3 * stride), hn::LoadU(row, from + 2 * stride)),
                       hn::Combine(two, hn::LoadU(row, from + stride), hn::LoadU(row, from)));
  }
}

HWY_INLINE std::uint32_t BitsOf(hn::Mask<FloatsTag> mask) {
  std::uint16_t bits = 0;
  hn::StoreMaskBits(kFloats, mask, reinterpret_cast<std::uint8_t*>(&bits));
  return bits;
}

// Doubled areas, and what barycentric coordinates are computed from, stay below 2^24.
constexpr int kMostExtent = 2048;
// Beyond it single precision may overflow.
constexpr float kMostMagnitude = 0x1p100F;

// The triangles of a star, as many at once as there are lanes, in single precision.
struct StarPlanes {
  static constexpr std::size_t kMost = hn::MaxLanes(kFloats);

  HWY_INLINE void Work(const Star& star, std::size_t first) {
    const std::int32_t *dx = star.ring.dx.data() + first, *dy = star.ring.dy.data() + first;
    const float* heights = star.ring.heights.data() + first;
    const auto u_x = hn::LoadU(kInts, dx), v_x = hn::LoadU(kInts, dx + 1), none = hn::Zero(kInts);
    const auto u_y = hn::LoadU(kInts, dy), v_y = hn::LoadU(kInts, dy + 1);
    const auto low_x = hn::Min(hn::Min(u_x, v_x), none), high_x = hn::Max(hn::Max(u_x, v_x), none);
    const auto low_y = hn::Min(hn::Min(u_y, v_y), none), high_y = hn::Max(hn::Max(u_y, v_y), none);
    const Floats pz = All(kFloats, star.height);
    const Floats u_z = hn::Sub(hn::LoadU(kFloats, heights), pz), v_z = hn::Sub(hn::LoadU(kFloats, heights + 1), pz);
    const Floats of_ux = hn::ConvertTo(kFloats, u_x), of_uy = hn::ConvertTo(kFloats, u_y);
    const Floats of_vx = hn::ConvertTo(kFloats, v_x), of_vy = hn::ConvertTo(kFloats, v_y);
    const Floats of_d = hn::Sub(hn::Mul(of_ux, of_vy), hn::Mul(of_uy, of_vx));
    hn::Store(of_ux, kFloats, ux);
    hn::Store(of_uy, kFloats, uy);
    hn::Store(of_vx, kFloats, vx);
    hn::Store(of_vy, kFloats, vy);
    hn::Store(of_d, kFloats, d);
    const Floats of_west = hn::ConvertTo(kFloats, low_x), of_south = hn::ConvertTo(kFloats, low_y);
    hn::Store(hn::Sub(hn::Mul(of_vy, of_west), hn::Mul(of_vx, of_south)), kFloats, u);
    hn::Store(hn::Sub(hn::Mul(of_ux, of_south), hn::Mul(of_uy, of_west)), kFloats, v);
    const Floats vy_uz = hn::Mul(of_vy, u_z), uy_vz = hn::Mul(of_uy, v_z);
    const Floats ux_vz = hn::Mul(of_ux, v_z), vx_uz = hn::Mul(of_vx, u_z);
    const Floats of_a = hn::Sub(vy_uz, uy_vz), of_b = hn::Sub(ux_vz, vx_uz);
    hn::Store(of_a, kFloats, a);
    hn::Store(of_b, kFloats, b);
    hn::Store(hn::Add(hn::Mul(of_a, of_west), hn::Mul(of_b, of_south)), kFloats, plane);
    const auto wide = hn::Sub(high_x, low_x), high = hn::Sub(high_y, low_y), extent = hn::Max(wide, high);
    hn::Store(low_x, kInts, west);
    hn::Store(low_y, kInts, south);
    hn::Store(wide, kInts, width);
    hn::Store(high, kInts, height);
    // No column or row of the triangle is further from p than its box is wide or high.
    const Floats across = hn::ConvertTo(kFloats, wide), up = hn::ConvertTo(kFloats, high);
    const Floats of_x = hn::Add(hn::Abs(vy_uz), hn::Abs(uy_vz)), of_y = hn::Add(hn::Abs(ux_vz), hn::Abs(vx_uz));
    const Floats most_plane = hn::Add(hn::Mul(hn::Abs(of_a), across), hn::Mul(hn::Abs(of_b), up));
    const Floats of_magnitude = hn::Add(hn::Mul(of_x, across), hn::Mul(of_y, up));
    hn::Store(hn::Add(hn::Add(of_x, of_y), most_plane), kFloats, largest);
    hn::Store(of_magnitude, kFloats, magnitude);

    const auto is_exact = hn::RebindMask(kFloats, hn::Lt(extent, All(kInts, kMostExtent + 1)));  // as of_d is
    // Pick's theorem: with 1, none but its corners.
    const auto has_samples = hn::Or(hn::Ne(of_d, All(kFloats, 1)), hn::Not(is_exact));
    const auto is_tame = hn::And(hn::Lt(of_magnitude, All(kFloats, kMostMagnitude)), is_exact);
    const auto is_small = hn::RebindMask(kFloats, hn::Lt(extent, All(kInts, 4)));
    const auto is_medium = hn::RebindMask(kFloats, hn::Lt(extent, All(kInts, kLargeSide)));
    const std::uint32_t lanes = BitsOf(has_samples), tame = lanes & BitsOf(is_tame);
    small = tame & BitsOf(is_small);
    medium = tame & BitsOf(is_medium) & ~small;
    wild = lanes & ~tame;
    large = tame & ~small & ~medium;
  }

  HWY_ALIGN float ux[kMost], uy[kMost], vx[kMost], vy[kMost], d[kMost], a[kMost], b[kMost];
  HWY_ALIGN float u[kMost], v[kMost], plane[kMost];  // at the south-west corner of the box: barycentric, and A x + B y
  HWY_ALIGN float largest[kMost];                    // no product or sum of the planes' is larger
  HWY_ALIGN float magnitude[kMost];                  // what rounding errors are relative to
  HWY_ALIGN std::int32_t west[kMost], south[kMost], width[kMost], height[kMost];  // bounding box
  std::uint32_t small, medium, large, wild;                                       // sets of lanes
};

// Single precision against double. With u = 2^-24 and the numerator N = |D (h - z_p) - (A x + B y)|, two roundings are
// relative to D (h - z_p), which is at most N + magnitude; four to A x and B y, five with their sum; one to N: all in
// all 3 u N + 7 u magnitude, and double's own errors are nothing beside that. A sample that is the furthest in double
// therefore is within 2^-20 (N + magnitude) of the furthest in single precision. Nothing underflows: every factor but
// one is an integer.
constexpr float kDoubt = 0x1p-20F;

// In blocks a plane begins at the box's corner, goes on to the lane, and steps from there, up to seven times: 3 u N and
// less than 24 u magnitude, fused or not. Two samples that are compared may be off in opposite ways.
constexpr float kDoubtInBlocks = 0x1p-18F;

// The smallest numerator that may be the largest one in double, once the largest in single precision is known. Where
// that is exact, no other. Never negative, however large the heights: what is below zero is no sample of the triangle.
HWY_INLINE float LeastInDoubt(float most, float largest, float magnitude, float most_exact, float doubt) {
  const float least = std::max(most - doubt * (most + magnitude), 0.0F);
  return most + largest < most_exact ? most : least;
}

// One block, from (west, south) relative to p: the largest numerator, negative if there is no sample, and which samples
// are as large as that or may be, row by row. No branch: which triangle lies where in its block cannot be foretold.
struct BlockFind {
  float most;
  std::uint64_t found;
};
template <int kSide>
HWY_INLINE BlockFind ScanBlock(const OpenSamples& samples, const Star& star, const StarPlanes& planes, std::size_t i,
                               float most_exact) {
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloats)), kRowsAtOnce = kLanes / kSide;
  constexpr int kVectors = kSide * kSide / kLanes;
  const Floats x = hn::Load(kFloats, kSide == 4 ? kColumnsBy4 : kColumnsBy8);
  const Floats y = hn::Load(kFloats, kSide == 4 ? kRowsBy4 : kRowsBy8);
  const Floats ux = All(kFloats, planes.ux[i]), vx = All(kFloats, planes.vx[i]), d = All(kFloats, planes.d[i]);
  const Floats b = All(kFloats, planes.b[i]), pz = All(kFloats, star.height);
  Floats of_u = hn::NegMulAdd(vx, y, hn::MulAdd(All(kFloats, planes.vy[i]), x, All(kFloats, planes.u[i])));
  Floats of_v = hn::NegMulAdd(All(kFloats, planes.uy[i]), x, hn::MulAdd(ux, y, All(kFloats, planes.v[i])));
  Floats of_p = hn::Sub(d, hn::Add(of_u, of_v));
  Floats plane = hn::MulAdd(b, y, hn::MulAdd(All(kFloats, planes.a[i]), x, All(kFloats, planes.plane[i])));
  const Floats at_once = All(kFloats, kRowsAtOnce);
  const Floats step_u = hn::Mul(vx, at_once), step_v = hn::Mul(ux, at_once), step_p = hn::Sub(step_u, step_v);
  const Floats step_plane = hn::Mul(b, at_once);

  const int stride = samples.stride();
  const float* const from = samples.Row(star.y + planes.south[i]) + star.x + planes.west[i];
  Floats numerators[kVectors];
  Floats most = All(kFloats, -1);
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    const Floats heights = RowsFrom<kSide>(from + k * kRowsAtOnce * stride, stride);
    const Floats numerator = hn::Abs(hn::MulSub(d, hn::Sub(heights, pz), plane));
    numerators[k] = hn::Or(numerator, NaNWhereNegative(of_u, of_v, of_p));
    most = MaxOrSecond(numerators[k], most);
    plane = hn::Add(plane, step_plane);
    of_u = hn::Sub(of_u, step_u);
    of_v = hn::Add(of_v, step_v);
    of_p = hn::Add(of_p, step_p);
  }
  BlockFind find{hn::GetLane(hn::MaxOfLanes(kFloats, most)), 0};
  const Floats least =
      All(kFloats, LeastInDoubt(find.most, planes.largest[i], planes.magnitude[i], most_exact, kDoubtInBlocks));
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    find.found |= std::uint64_t{BitsOf(hn::Ge(numerators[k], least))} << (k * kLanes);
  }
  return find;
}

// A sample's numerator in double, as the header has it.
HWY_INLINE double NumeratorAt(const OpenSamples& samples, const ExactPlane& t, int x, int y) {
  const double height = static_cast<double>(samples.Row(t.py + y)[t.px + x]);
  return std::abs(t.d * (height - t.pz) - (t.a * x + t.b * y));
}

// What ScanBlock found: most often a single sample.
template <int kSide>
HWY_INLINE PlaneMisfit MisfitOf(const OpenSamples& samples, const Star& star, const StarPlanes& planes, std::size_t i,
                                std::size_t first, const BlockFind& find, float most_exact) {
  if (find.most < 0) return {};
  const int west = planes.west[i], south = planes.south[i];
  const int base = (star.y + south) * samples.width() + star.x + west;
  const auto sample = [&](int k) { return static_cast<std::uint32_t>(base + k / kSide * samples.width() + k % kSide); };
  if (find.most + planes.largest[i] < most_exact) {
    return {static_cast<double>(find.most) / static_cast<double>(planes.d[i]), sample(std::countr_zero(find.found))};
  }
  if (!(find.most < kMostMagnitude)) return ScanExactly(samples, ExactPlaneOf(star, first + i));
  const ExactPlane t = ExactPlaneOf(star, first + i);
  double most = -1;
  int best = 0;
  for (std::uint64_t found = find.found; found != 0; found &= found - 1) {
    const int k = std::countr_zero(found);
    const double numerator = NumeratorAt(samples, t, west + k % kSide, south + k / kSide);
    if (!(numerator > most)) continue;
    most = numerator;
    best = k;
  }
  return {most / t.d, sample(best)};
}

// In single precision: what StarPlanes::Work found.
HWY_INLINE SinglePlane SinglePlaneOf(const Star& star, const StarPlanes& planes, std::size_t i, std::size_t first) {
  const std::int32_t *dx = star.ring.dx.data() + first + i, *dy = star.ring.dy.data() + first + i;
  const int west = planes.west[i], south = planes.south[i];
  return {.px = star.x,
          .py = star.y,
          .ux = dx[0],
          .uy = dy[0],
          .vx = dx[1],
          .vy = dy[1],
          .west = west,
          .east = west + planes.width[i],
          .south = south,
          .north = south + planes.height[i],
          .pz = star.height,
          .d = planes.d[i],
          .a = planes.a[i],
          .b = planes.b[i]};
}

// A larger triangle where single precision is not exact: no lane may hold two samples that are in doubt.
PlaneMisfit ScanDoubtfully(const OpenSamples& samples, const Star& star, const StarPlanes& planes, std::size_t i,
                           std::size_t first, float most_exact) {
  const auto two = ScanWide<FurthestTwo>(samples, SinglePlaneOf(star, planes, i, first));
  const float single = two.numerator();
  if (single < 0) return {};
  const ExactPlane t = ExactPlaneOf(star, first + i);
  const float least = LeastInDoubt(single, planes.largest[i], planes.magnitude[i], most_exact, kDoubt);
  if (!(single < kMostMagnitude) || two.runner_up() >= least) return ScanExactly(samples, t);
  HWY_ALIGN std::int32_t indices[hn::MaxLanes(kFloats)];
  hn::Store(two.furthest().indices(), kInts, indices);
  double most = -1;
  std::uint32_t best = kNoSample;
  for (std::uint32_t bits = BitsOf(hn::Ge(two.furthest().numerators(), All(kFloats, least))); bits != 0;
       bits &= bits - 1) {
    const std::int32_t index = indices[std::countr_zero(bits)];
    const auto sample = static_cast<std::uint32_t>(index);
    const double numerator = NumeratorAt(samples, t, index % samples.width() - t.px, index / samples.width() - t.py);
    if (numerator < most || (numerator == most && sample > best)) continue;
    most = numerator;
    best = sample;
  }
  return {most / t.d, best};
}

HWY_INLINE PlaneMisfit ScanLarge(const OpenSamples& samples, const Star& star, const StarPlanes& planes, std::size_t i,
                                 std::size_t first, float most_exact) {
  if (planes.largest[i] < most_exact) {
    const auto furthest = ScanWide<Furthest<FloatsTag>>(samples, SinglePlaneOf(star, planes, i, first));
    const float numerator = furthest.numerator();
    if (numerator < 0) return {};
    if (numerator + planes.largest[i] < most_exact) {
      return {static_cast<double>(numerator) / static_cast<double>(planes.d[i]), furthest.sample()};
    }
  }
  return ScanDoubtfully(samples, star, planes, i, first, most_exact);
}

// Class by class, not triangle by triangle: what a triangle takes cannot be foretold.
HWY_INLINE void ScanTogether(const OpenSamples& samples, const Star& star, const StarPlanes& planes, std::size_t first,
                             std::uint32_t lanes, float most_exact, PlaneMisfit* misfits) {
  BlockFind finds[StarPlanes::kMost];
  const auto lane = [](std::uint32_t bits) { return static_cast<std::size_t>(std::countr_zero(bits)); };
  const std::uint32_t small = planes.small & lanes, medium = planes.medium & lanes;
  for (std::uint32_t bits = small; bits != 0; bits &= bits - 1) {
    finds[lane(bits)] = ScanBlock<4>(samples, star, planes, lane(bits), most_exact);
  }
  if constexpr (kLargeSide == 8) {
    for (std::uint32_t bits = medium; bits != 0; bits &= bits - 1) {
      finds[lane(bits)] = ScanBlock<8>(samples, star, planes, lane(bits), most_exact);
    }
  }
  for (std::uint32_t bits = lanes; bits != 0; bits &= bits - 1) misfits[lane(bits)] = {};
  for (std::uint32_t bits = small; bits != 0; bits &= bits - 1) {
    misfits[lane(bits)] = MisfitOf<4>(samples, star, planes, lane(bits), first, finds[lane(bits)], most_exact);
  }
  for (std::uint32_t bits = medium; bits != 0; bits &= bits - 1) {
    misfits[lane(bits)] = MisfitOf<kLargeSide>(samples, star, planes, lane(bits), first, finds[lane(bits)], most_exact);
  }
  for (std::uint32_t bits = planes.large & lanes; bits != 0; bits &= bits - 1) {
    misfits[lane(bits)] = ScanLarge(samples, star, planes, lane(bits), first, most_exact);
  }
  for (std::uint32_t bits = planes.wild & lanes; bits != 0; bits &= bits - 1) {
    misfits[lane(bits)] = ScanExactly(samples, ExactPlaneOf(star, first + lane(bits)));
  }
}

#endif

}  // namespace

void ScanStar(const OpenSamples& samples, const Star& star, PlaneMisfit* misfits) {
#if HWY_TARGET == HWY_SCALAR
  for (std::size_t i = 0; i < star.count; ++i) misfits[i] = ScanExactly(samples, ExactPlaneOf(star, i));
#else
  StarPlanes planes;
  const std::size_t lanes = hn::Lanes(kFloats);
  const float most_exact = samples.quantum() * 0xFFFF00;
  for (std::size_t first = 0; first < star.count; first += lanes) {
    planes.Work(star, first);
    const std::size_t count = std::min(lanes, star.count - first);
    ScanTogether(samples, star, planes, first, (1U << count) - 1, most_exact, misfits + first);
  }
#endif
}

}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace terrace::tin {

HWY_EXPORT(ScanStar);

StarScan BestStarScan() {
  // Not at each call: the question traps where the processor is a virtual one.
  if (!hwy::GetChosenTarget().IsInitialized()) hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return HWY_DYNAMIC_DISPATCH(ScanStar);
}

}  // namespace terrace::tin
#endif
