// The scan of wide triangles, and of those that single precision cannot tell apart: row by row, or by vectors of
// columns. Compiled once for each set of instructions; part of triangle_scan.cc.
#if defined(TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_
#undef TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_
#else
#define TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "engine/tin/height_field.h"
#include "engine/tin/star.h"
#include "engine/tin/triangle_scan.h"

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

// Everything is evaluated in double, in single precision or in integers, whichever is quickest and gives the same.
// Single is as good as double for most triangles: all heights are
// multiples of a quantum (HeightField::quantum), so all numbers that the formula adds and multiplies are, and every
// multiple up to 2^24 times the quantum is a float. Where that may be exceeded, it is double.
using DoublesTag = hn::CappedTag<double, 16>;
using FloatsTag = hn::CappedTag<float, 16>;
constexpr DoublesTag kDoubles;
constexpr FloatsTag kFloats;
using Floats = hn::Vec<FloatsTag>;

// Row-major indices: in doubles beside doubles, in integers beside floats, which cannot hold them.
template <typename Tag>
using IndexTag = std::conditional_t<std::is_same_v<hn::TFromD<Tag>, float>, hn::RebindToSigned<Tag>, Tag>;
using IntsTag = IndexTag<FloatsTag>;
using Ints = hn::Vec<IntsTag>;
constexpr IntsTag kInts;

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
  int west, east, south, north;  // bounding box without the field's border
  Number pz;
  Number d, a, b;  // D, A and B of the header
};
using ExactPlane = TrianglePlane<double>;
using SinglePlane = TrianglePlane<float>;

// In quanta (HeightField::quantum), modulo 2^32: numerators are right if they are below 2^31, whatever became of the
// products and sums on the way there. A height h less p's, plus `lift`, is a float whose last 23 bits count quanta; as
// an integer, those of all of its bits that are beyond p's are the difference.
struct IntegerPlane : TrianglePlane<std::int32_t> {  // pz: D times p's bits
  float z, lift;
};

// The numbers of samples that are visited.
template <typename Found>
using PlaneFor = std::conditional_t<std::is_same_v<hn::TFromD<typename Found::Tag>, std::int32_t>, IntegerPlane,
                                    TrianglePlane<hn::TFromD<typename Found::Tag>>>;

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
    } else if constexpr (std::is_same_v<Tag, IntsTag>) {
      numerator_ = hn::Max(numerator, numerator_);
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

template <typename Found>
inline constexpr bool kIsInteger = std::is_same_v<Found, Furthest<IntsTag>>;
// Whether sums are exact where it is used: planes may be stepped then.
template <typename Found>
inline constexpr bool kIsExact = std::is_same_v<Found, Furthest<FloatsTag>> || kIsInteger<Found>;

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
// and on the edges none is negative, and at a corner one of them is D.
class Barycentric {
 public:
  using Doubles = hn::Vec<DoublesTag>;

  HWY_INLINE Barycentric(const ExactPlane& t, Doubles x, Doubles y)
      : step_u_(All(kDoubles, 2 * t.vx)),
        step_v_(All(kDoubles, 2 * t.ux)),
        step_p_(hn::Sub(step_u_, step_v_)),
        d_(All(kDoubles, t.d)),
        of_u_(hn::Sub(hn::Mul(All(kDoubles, t.vy), x), hn::Mul(All(kDoubles, t.vx), y))),
        of_v_(hn::Sub(hn::Mul(All(kDoubles, t.ux), y), hn::Mul(All(kDoubles, t.uy), x))),
        of_p_(hn::Sub(d_, hn::Add(of_u_, of_v_))) {}

  HWY_INLINE hn::Mask<DoublesTag> IsInsideAndNoCorner() const {
    return hn::And(hn::Ge(hn::Min(hn::Min(of_u_, of_v_), of_p_), hn::Zero(kDoubles)),
                   hn::Lt(hn::Max(hn::Max(of_u_, of_v_), of_p_), d_));
  }
  // Two rows on.
  HWY_INLINE void Step() {
    of_u_ = hn::Sub(of_u_, step_u_);
    of_v_ = hn::Add(of_v_, step_v_);
    of_p_ = hn::Add(of_p_, step_p_);
  }

 private:
  Doubles step_u_, step_v_, step_p_, d_;
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

// A number for the columns of a box up to its last one, and NaN, which no comparison holds for, beyond: a triangle may
// reach on to the field's border.
template <typename Tag>
HWY_INLINE hn::Vec<Tag> UpToColumn(Tag tag, int last, hn::Vec<Tag> columns, hn::TFromD<Tag> number) {
  const hn::TFromD<Tag> none = std::numeric_limits<hn::TFromD<Tag>>::quiet_NaN();
  return hn::IfThenElse(hn::Le(columns, All(tag, last)), All(tag, number), All(tag, none));
}

// And in integers.
HWY_INLINE Ints NumeratorFrom(const float* heights, Floats z, Floats lift, Ints d, Ints plane) {
  const Floats lifted = hn::Add(hn::Sub(hn::LoadU(kFloats, heights), z), lift);
  return hn::Abs(hn::Sub(hn::Mul(hn::BitCast(kInts, lifted), d), plane));
}

// The numerators of some columns, from the first row of the box on. NaN beyond its last column, or negative.
template <typename Found>
class ColumnsOfPlane {
 public:
  HWY_INLINE ColumnsOfPlane(const SinglePlane& t, int column)
      : d_(All(kFloats, t.d)),
        b_(All(kFloats, t.b)),
        pz_(UpToColumn(kFloats, t.east, From(kFloats, column), t.pz)),
        a_x_(hn::Mul(All(kFloats, t.a), From(kFloats, column))),
        y_(All(kFloats, t.south)),
        plane_(hn::MulAdd(b_, y_, a_x_)) {}

  HWY_INLINE Floats Numerators(const float* heights) const { return NumeratorFrom(heights, pz_, d_, plane_); }
  HWY_INLINE void Step() {
    if constexpr (kIsExact<Found>) {
      plane_ = hn::Add(plane_, b_);
    } else {
      y_ = hn::Add(y_, All(kFloats, 1));
      plane_ = hn::MulAdd(b_, y_, a_x_);
    }
  }

 private:
  Floats d_, b_, pz_, a_x_, y_, plane_;
};
template <>
class ColumnsOfPlane<Furthest<IntsTag>> {
 public:
  HWY_INLINE ColumnsOfPlane(const IntegerPlane& t, int column)
      : z_(All(kFloats, t.z)),
        lift_(All(kFloats, t.lift)),
        d_(All(kInts, t.d)),
        b_(All(kInts, t.b)),
        beyond_(hn::VecFromMask(kInts, hn::Gt(From(kInts, column), All(kInts, t.east)))),
        plane_(hn::Add(hn::Add(All(kInts, t.pz), hn::Mul(b_, All(kInts, t.south))),
                       hn::Mul(All(kInts, t.a), From(kInts, column)))) {}

  HWY_INLINE Ints Numerators(const float* heights) const {
    return hn::Or(NumeratorFrom(heights, z_, lift_, d_, plane_), beyond_);
  }
  HWY_INLINE void Step() { plane_ = hn::Add(plane_, b_); }

 private:
  Floats z_, lift_;
  Ints d_, b_, beyond_, plane_;
};

// Every sample of some columns of the bounding box, in single precision or integers: no spans, no divisions, no
// branches but the loop. Barycentric coordinates are integers, whose signs make what is outside NaN, or negative.
template <typename Found>
HWY_INLINE Found ScanColumnsInSingle(const HeightField& field, const PlaneFor<Found>& t, int column) {
  constexpr typename Found::Tag tag;
  const auto x = From(kInts, column);
  auto of_u = hn::Sub(hn::Mul(All(kInts, t.vy), x), All(kInts, t.vx * t.south));
  auto of_v = hn::Sub(All(kInts, t.ux * t.south), hn::Mul(All(kInts, t.uy), x));
  auto of_p = hn::Sub(All(kInts, t.ux * t.vy - t.uy * t.vx), hn::Add(of_u, of_v));
  const auto step_u = All(kInts, t.vx), step_v = All(kInts, t.ux), step_p = All(kInts, t.vx - t.ux);
  const int width = field.width(), stride = field.stride(), first_row = t.py + t.south;
  const float* from = field.Row(first_row) + t.px + column;
  auto index = From(kInts, first_row * width + t.px + column);
  const auto next_row = All(kInts, width);
  ColumnsOfPlane<Found> plane(t, column);
  Found furthest;
  for (int j = t.south; j <= t.north; ++j) {
    const auto outside = hn::ShiftRight<31>(hn::Or3(of_u, of_v, of_p));
    furthest.Visit(hn::Or(plane.Numerators(from), hn::BitCast(tag, outside)), index);
    from += stride;
    plane.Step();
    index = hn::Add(index, next_row);
    of_u = hn::Sub(of_u, step_u);
    of_v = hn::Add(of_v, step_v);
    of_p = hn::Add(of_p, step_p);
  }
  return furthest;
}

// The same in double, without the corners, two rows at a time, each for itself, since what is furthest so far is waited
// for. After an odd number of rows the last one is looked at again.
HWY_INLINE Furthest<DoublesTag> ScanColumnsInDouble(const HeightField& field, const ExactPlane& t, int column) {
  constexpr DoublesTag tag;
  constexpr IndexTag<DoublesTag> indices;
  const auto d = All(tag, t.d), b = All(tag, t.b), one = All(tag, 1), two = All(tag, 2), last = All(tag, t.north);
  const auto x = From(tag, column), a_x = hn::Mul(All(tag, t.a), x), pz = UpToColumn(tag, t.east, x, t.pz);
  auto y = All(tag, t.south), above = hn::Add(y, one);
  Barycentric even(t, x, y), odd(t, x, above);
  const int width = field.width(), stride = field.stride(), first_row = t.py + t.south;
  const float* from = field.Row(first_row) + t.px + column;
  const auto next_row = All(indices, width);
  auto index = From(indices, first_row * width + t.px + column);
  Furthest<DoublesTag> furthest, also;
  for (int j = t.south; j <= t.north; j += 2) {
    const float* const from_above = j < t.north ? from + stride : from;
    furthest.Visit(Numerator(HeightsAt(tag, from), pz, d, hn::Add(a_x, hn::Mul(b, y))), index,
                   even.IsInsideAndNoCorner());
    index = hn::Add(index, next_row);
    also.Visit(Numerator(HeightsAt(tag, from_above), pz, d, hn::Add(a_x, hn::Mul(b, above))), index,
               hn::And(odd.IsInsideAndNoCorner(), hn::Le(above, last)));
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
HWY_INLINE Found ScanColumns(const HeightField& field, const PlaneFor<Found>& t, int column) {
  if constexpr (std::is_same_v<typename Found::Tag, DoublesTag>) {
    return ScanColumnsInDouble(field, t, column);
  } else {
    return ScanColumnsInSingle<Found>(field, t, column);
  }
}

template <typename Found>
HWY_INLINE Found ScanBox(const HeightField& field, const PlaneFor<Found>& t) {
  const int lanes = LanesOf<typename Found::Tag>();
  Found furthest = ScanColumns<Found>(field, t, t.west);
  for (int column = t.west + lanes; column <= t.east; column += lanes) {
    furthest.Merge(ScanColumns<Found>(field, t, column));
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

  template <typename Plane>
  HWY_INLINE explicit SpanFinder(const Plane& t) : px_(t.px), first_(t.px + t.west), last_(t.px + t.east) {
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

  // Of some rows from `first_row` on, relative to p; columns are those of the field, without its border.
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

// Fused in single precision only.
template <typename Found, typename V>
HWY_INLINE V MulAddFor(V a, V b, V c) {
  if constexpr (std::is_same_v<typename Found::Tag, FloatsTag>) {
    return hn::MulAdd(a, b, c);
  } else {
    return hn::Add(hn::Mul(a, b), c);
  }
}

// Row by row, exact spans. In double without the corners.
template <typename Found>
HWY_INLINE Found ScanSpans(const HeightField& field, const PlaneFor<Found>& t) {
  using Tag = typename Found::Tag;
  constexpr Tag tag;
  constexpr IndexTag<Tag> indices;
  const auto d = All(tag, t.d), a = All(tag, t.a), b = All(tag, t.b), pz = All(tag, t.pz), one = All(tag, 1);
  const int lanes = LanesOf<Tag>(), last_row = t.py + t.north, width = field.width();
  const auto lanes_on = All(tag, lanes), none = All(tag, -1);
  const auto corner = [&](int x, int y) HWY_ATTR { return All(indices, (t.py + y) * width + t.px + x); };
  [[maybe_unused]] const auto at_p = corner(0, 0), at_u = corner(t.ux, t.uy), at_v = corner(t.vx, t.vy);
  [[maybe_unused]] const auto a_on = hn::Mul(a, lanes_on);
  const auto indices_on = All(indices, lanes);
  Found furthest, also, ends;  // apart, since what is furthest so far is waited for
  Columns firsts, lasts;
  const SpanFinder<std::conditional_t<kIsInteger<Found>, FloatsTag, Tag>> finder(t);
  for (int block = t.py + t.south; block <= last_row; block += kRows) {
    const int rows = std::min(kRows, last_row - block + 1);
    finder.Find(block - t.py, rows, firsts, lasts);
    auto y = All(tag, block - t.py);
    for (int j = 0; j < rows; ++j) {
      const int first = firsts[static_cast<std::size_t>(j)], last = lasts[static_cast<std::size_t>(j)], row = block + j;
      const float* from = field.Row(row) + first;
      auto b_y = hn::Mul(b, y);
      if constexpr (kIsInteger<Found>) b_y = hn::Add(b_y, pz);
      const auto end = All(indices, row * width + last + 1);
      y = hn::Add(y, one);
      auto x = From(tag, first - t.px);
      auto plane = MulAddFor<Found>(a, x, b_y);
      auto index = From(indices, row * width + first);
      int left = last - first + 1;
      const auto numerator = [&]() HWY_ATTR {
        if constexpr (std::is_same_v<Tag, FloatsTag>) {
          return NumeratorFrom(from, pz, d, plane);
        } else if constexpr (kIsInteger<Found>) {
          return NumeratorFrom(from, All(kFloats, t.z), All(kFloats, t.lift), d, plane);
        } else {
          const auto is_corner = hn::Or(hn::Or(hn::Eq(index, at_p), hn::Eq(index, at_u)), hn::Eq(index, at_v));
          return hn::IfThenElse(is_corner, none, Numerator(HeightsAt(tag, from), pz, d, plane));
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

template <typename Number>
HWY_INLINE void LeaveBorderOut(const HeightField& field, TrianglePlane<Number>& t) {
  t.west = std::max(t.west, 1 - t.px), t.east = std::min(t.east, field.width() - 2 - t.px);
  t.south = std::max(t.south, 1 - t.py), t.north = std::min(t.north, field.height() - 2 - t.py);
}

// In double: from the ring, one by one.
HWY_INLINE ExactPlane ExactPlaneOf(const HeightField& field, const Star& star, std::size_t i) {
  ExactPlane t;
  t.px = star.x, t.py = star.y;
  t.ux = star.ring.dx[i], t.uy = star.ring.dy[i], t.vx = star.ring.dx[i + 1], t.vy = star.ring.dy[i + 1];
  // Two by two: of a list they are found with branches.
  t.west = std::min(std::min(t.ux, t.vx), 0), t.east = std::max(std::max(t.ux, t.vx), 0);
  t.south = std::min(std::min(t.uy, t.vy), 0), t.north = std::max(std::max(t.uy, t.vy), 0);
  LeaveBorderOut(field, t);
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
HWY_INLINE Found ScanWide(const HeightField& field, const PlaneFor<Found>& t) {
  return t.east - t.west < kMostBoxVectors * LanesOf<typename Found::Tag>() ? ScanBox<Found>(field, t)
                                                                            : ScanSpans<Found>(field, t);
}

HWY_NOINLINE PlaneMisfit ScanExactly(const HeightField& field, const ExactPlane& t) {
  const auto furthest = ScanWide<Furthest<DoublesTag>>(field, t);
  if (furthest.numerator() < 0) return {};
  return {furthest.numerator() / t.d, furthest.sample()};
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace terrace::tin
HWY_AFTER_NAMESPACE();

#endif  // per-target include guard
