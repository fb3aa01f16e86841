// The scan of wide triangles, and of triangles for which single precision is not enough: row by row, or by vectors of
// columns. Compiled once for each instruction set; part of triangle_scan.cc.
#if defined(TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_
#undef TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_
#else
#define TERRACE_ENGINE_TIN_WIDE_SCAN_INL_H_
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/scan/furthest-inl.h"
#include "engine/tin/scan/span_finder-inl.h"
#include "engine/tin/scan/triangle_scan.h"

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

// A triangle and its plane in one of the precisions.
template <typename Number>
struct TrianglePlane : TriangleBox {
  Number pz;
  Number d, a, b;  // D, A and B of triangle_scan.h
};
using ExactPlane = TrianglePlane<double>;
using SinglePlane = TrianglePlane<float>;

// In quanta (HeightField::quantum), modulo 2^32: numerators below 2^31 are right even if intermediate products and sums
// overflow. The float h - z + lift has a mantissa that counts quanta. The difference between its bits and those of p's
// height, as integers, is the height difference in quanta.
struct IntegerPlane : TrianglePlane<std::int32_t> {  // pz: D times p's bits
  float z, lift;
};

// The type of plane for a kind of Furthest.
template <typename Found>
using PlaneFor = std::conditional_t<std::is_same_v<hn::TFromD<typename Found::Tag>, std::int32_t>, IntegerPlane,
                                    TrianglePlane<hn::TFromD<typename Found::Tag>>>;

HWY_INLINE hn::Vec<DoublesTag> HeightsAt(DoublesTag tag, const float* from) {
  return hn::PromoteTo(tag, hn::LoadU(hn::Rebind<float, DoublesTag>(), from));
}

// Barycentric coordinates times D of samples relative to p. They are integers and exact, also if stepped from row to
// row. None is negative inside and on the edges; at a corner one of them is D.
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
  // Moves two rows up.
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

// The same in single precision. The sign does not matter, and in this order the load is part of the subtraction. Fused
// if the processor can: exact results stay exact, and inexact ones get smaller errors.
HWY_INLINE Floats NumeratorFrom(const float* heights, Floats pz, Floats d, Floats plane) {
  return hn::Abs(hn::MulAdd(d, hn::Sub(pz, hn::LoadU(kFloats, heights)), plane));
}

// The same in integers.
HWY_INLINE Ints NumeratorFrom(const float* heights, Floats z, Floats lift, Ints d, Ints plane) {
  const Floats lifted = hn::Add(hn::Sub(hn::LoadU(kFloats, heights), z), lift);
  return hn::Abs(hn::Sub(hn::Mul(hn::BitCast(kInts, lifted), d), plane));
}

// Returns `number` in the columns up to `last`, and NaN beyond, for which comparisons are false: the triangle may reach
// beyond the box to the field's border.
template <typename Tag>
HWY_INLINE hn::Vec<Tag> UpToColumn(Tag tag, int last, hn::Vec<Tag> columns, hn::TFromD<Tag> number) {
  const hn::TFromD<Tag> none = std::numeric_limits<hn::TFromD<Tag>>::quiet_NaN();
  return hn::IfThenElse(hn::Le(columns, All(tag, last)), All(tag, number), All(tag, none));
}

// The numerators of a vector of columns, from the first row of the box on. NaN or negative beyond the last column.
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

// Scans a vector of columns of the bounding box row by row, in single precision or integers, without spans, divisions
// or branches. The signs of integer barycentric coordinates turn samples outside the triangle into NaN or negative
// numbers.
template <typename Found>
class ColumnsOfTriangle {
 public:
  HWY_INLINE ColumnsOfTriangle(const PlaneFor<Found>& t, int column)
      : step_u_(All(kInts, t.vx)), step_v_(All(kInts, t.ux)), step_p_(All(kInts, t.vx - t.ux)), plane_(t, column) {
    const auto x = From(kInts, column);
    of_u_ = hn::Sub(hn::Mul(All(kInts, t.vy), x), All(kInts, t.vx * t.south));
    of_v_ = hn::Sub(All(kInts, t.ux * t.south), hn::Mul(All(kInts, t.uy), x));
    of_p_ = hn::Sub(All(kInts, t.ux * t.vy - t.uy * t.vx), hn::Add(of_u_, of_v_));
  }

  // Visits the samples of a row from `heights` on, and moves to the next row.
  HWY_INLINE void Visit(const float* heights, Ints numbers) {
    const auto outside = hn::ShiftRight<31>(hn::Or3(of_u_, of_v_, of_p_));
    furthest_.Visit(hn::Or(plane_.Numerators(heights), hn::BitCast(typename Found::Tag(), outside)), numbers);
    plane_.Step();
    of_u_ = hn::Sub(of_u_, step_u_);
    of_v_ = hn::Add(of_v_, step_v_);
    of_p_ = hn::Add(of_p_, step_p_);
  }
  HWY_INLINE const Found& furthest() const { return furthest_; }

 private:
  Ints step_u_, step_v_, step_p_;
  Ints of_u_, of_v_, of_p_;
  ColumnsOfPlane<Found> plane_;
  Found furthest_;
};

// Calls visit(heights, numbers) for each row of the box from a column on, with a pointer to its samples and a vector of
// their numbers.
template <typename Visit>
HWY_INLINE void ForEachRow(const HeightField& field, const TriangleBox& t, int column, Visit&& visit) {
  const int stride = field.stride(), first_row = t.py + t.south;
  const float* from = field.Row(first_row) + t.px + column;
  auto numbers = From(kInts, SampleNumber(t.px + column, first_row));
  const auto next_row = All(kInts, SampleNumber(0, 1));
  for (int j = t.south; j <= t.north; ++j) {
    visit(from, numbers);
    from += stride;
    numbers = hn::Add(numbers, next_row);
  }
}

template <typename Found>
HWY_INLINE Found ScanColumnsIn32Bits(const HeightField& field, const PlaneFor<Found>& t, int column) {
  ColumnsOfTriangle<Found> columns(t, column);
  ForEachRow(field, t, column, [&](const float* heights, Ints numbers) HWY_ATTR { columns.Visit(heights, numbers); });
  return columns.furthest();
}

// Two vectors of columns side by side: they share the row counter and are independent of each other. Needs more than
// the sixteen vector registers of AVX2.
#if (HWY_ARCH_X86 && HWY_TARGET > HWY_AVX3) || HWY_ARCH_ARM_V7
constexpr bool kColumnsInPairs = false;
#else
constexpr bool kColumnsInPairs = true;
#endif
template <typename Found>
HWY_INLINE Found ScanColumnPairIn32Bits(const HeightField& field, const PlaneFor<Found>& t, int column) {
  const int lanes = LanesOf<typename Found::Tag>();
  ColumnsOfTriangle<Found> west(t, column), east(t, column + lanes);
  ForEachRow(field, t, column, [&](const float* heights, Ints numbers) HWY_ATTR {
    west.Visit(heights, numbers);
    east.Visit(heights + lanes, numbers);
  });
  Found furthest = east.furthest();
  furthest.MoveEast(lanes);
  furthest.Merge(west.furthest());
  return furthest;
}

// The same in double, without the corners. Two rows at a time, independent of each other, to hide latency. If the
// number of rows is odd, the last row is visited twice.
HWY_INLINE Furthest<DoublesTag> ScanColumnsInDouble(const HeightField& field, const ExactPlane& t, int column) {
  constexpr DoublesTag tag;
  constexpr NumberTag<DoublesTag> numbers;
  const auto d = All(tag, t.d), b = All(tag, t.b), one = All(tag, 1), two = All(tag, 2), last = All(tag, t.north);
  const auto x = From(tag, column), a_x = hn::Mul(All(tag, t.a), x), pz = UpToColumn(tag, t.east, x, t.pz);
  auto y = All(tag, t.south), above = hn::Add(y, one);
  Barycentric even(t, x, y), odd(t, x, above);
  const int stride = field.stride(), first_row = t.py + t.south;
  const float* from = field.Row(first_row) + t.px + column;
  const auto next_row = All(numbers, SampleNumber(0, 1));
  auto number = From(numbers, SampleNumber(t.px + column, first_row));
  Furthest<DoublesTag> furthest, also;
  for (int j = t.south; j <= t.north; j += 2) {
    const float* const from_above = j < t.north ? from + stride : from;
    furthest.Visit(Numerator(HeightsAt(tag, from), pz, d, hn::Add(a_x, hn::Mul(b, y))), number,
                   even.IsInsideAndNoCorner());
    number = hn::Add(number, next_row);
    also.Visit(Numerator(HeightsAt(tag, from_above), pz, d, hn::Add(a_x, hn::Mul(b, above))), number,
               hn::And(odd.IsInsideAndNoCorner(), hn::Le(above, last)));
    number = hn::Add(number, next_row);
    from += 2 * stride;
    y = hn::Add(y, two);
    above = hn::Add(above, two);
    even.Step();
    odd.Step();
  }
  furthest.Merge(also);
  return furthest;
}

// Up to this many vectors of columns, scanning the box is faster than scanning spans.
constexpr int kMaxBoxVectors = 3;

template <typename Found>
HWY_INLINE Found ScanColumns(const HeightField& field, const PlaneFor<Found>& t, int column) {
  if constexpr (std::is_same_v<typename Found::Tag, DoublesTag>) {
    return ScanColumnsInDouble(field, t, column);
  } else {
    return ScanColumnsIn32Bits<Found>(field, t, column);
  }
}

template <typename Found>
HWY_INLINE Found ScanBox(const HeightField& field, const PlaneFor<Found>& t) {
  constexpr bool kIsPaired = kColumnsInPairs && !std::is_same_v<typename Found::Tag, DoublesTag>;
  const int lanes = LanesOf<typename Found::Tag>();
  if constexpr (kIsPaired) {
    static_assert(kMaxBoxVectors == 3);
    const int second = t.west + lanes, third = second + lanes;
    if (second > t.east) return ScanColumns<Found>(field, t, t.west);
    Found furthest = ScanColumnPairIn32Bits<Found>(field, t, t.west);
    if (third <= t.east) furthest.Merge(ScanColumns<Found>(field, t, third));
    return furthest;
  }
  Found furthest = ScanColumns<Found>(field, t, t.west);
  for (int column = t.west + lanes; column <= t.east; column += lanes) {
    furthest.Merge(ScanColumns<Found>(field, t, column));
  }
  return furthest;
}

// Multiplies and adds; fused only in single precision.
template <typename Found, typename V>
HWY_INLINE V MulAddFor(V a, V b, V c) {
  if constexpr (std::is_same_v<typename Found::Tag, FloatsTag>) {
    return hn::MulAdd(a, b, c);
  } else {
    return hn::Add(hn::Mul(a, b), c);
  }
}

// Scans exact spans row by row. In double without the corners.
template <typename Found>
HWY_INLINE Found ScanSpans(const HeightField& field, const PlaneFor<Found>& t) {
  using Tag = typename Found::Tag;
  constexpr Tag tag;
  constexpr NumberTag<Tag> numbers;
  const auto d = All(tag, t.d), a = All(tag, t.a), b = All(tag, t.b), pz = All(tag, t.pz), one = All(tag, 1);
  const int lanes = LanesOf<Tag>(), last_row = t.py + t.north;
  const auto lanes_on = All(tag, lanes), none = All(tag, -1);
  const auto corner = [&](int x, int y) HWY_ATTR { return All(numbers, SampleNumber(t.px + x, t.py + y)); };
  [[maybe_unused]] const auto at_p = corner(0, 0), at_u = corner(t.ux, t.uy), at_v = corner(t.vx, t.vy);
  [[maybe_unused]] const auto a_on = hn::Mul(a, lanes_on);
  const auto numbers_on = All(numbers, lanes);
  Found furthest, also, ends;  // independent, to hide latency
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
      const auto end = All(numbers, SampleNumber(last + 1, row));
      y = hn::Add(y, one);
      auto x = From(tag, first - t.px);
      auto plane = MulAddFor<Found>(a, x, b_y);
      auto number = From(numbers, SampleNumber(first, row));
      int left = last - first + 1;
      const auto numerator = [&]() HWY_ATTR {
        if constexpr (std::is_same_v<Tag, FloatsTag>) {
          return NumeratorFrom(from, pz, d, plane);
        } else if constexpr (kIsInteger<Found>) {
          return NumeratorFrom(from, All(kFloats, t.z), All(kFloats, t.lift), d, plane);
        } else {
          const auto is_corner = hn::Or(hn::Or(hn::Eq(number, at_p), hn::Eq(number, at_u)), hn::Eq(number, at_v));
          return hn::IfThenElse(is_corner, none, Numerator(HeightsAt(tag, from), pz, d, plane));
        }
      };
      const auto visit = [&](Found& found) HWY_ATTR {
        found.Visit(numerator(), number);
        from += lanes;
        number = hn::Add(number, numbers_on);
        if constexpr (kIsExact<Found>) {
          plane = hn::Add(plane, a_on);
        } else {
          x = hn::Add(x, lanes_on);
          plane = MulAddFor<Found>(a, x, b_y);
        }
      };
      for (; left >= 2 * lanes; left -= 2 * lanes) visit(furthest), visit(also);
      if (left >= lanes) visit(also);
      const auto inside = hn::RebindMask(tag, hn::Lt(number, end));
      ends.Visit(hn::IfThenElse(inside, numerator(), none), number);
    }
  }
  furthest.Merge(also);
  furthest.Merge(ends);
  return furthest;
}

HWY_INLINE void LeaveBorderOut(const HeightField& field, TriangleBox& t) {
  t.west = std::max(t.west, 1 - t.px), t.east = std::min(t.east, field.width() - 2 - t.px);
  t.south = std::max(t.south, 1 - t.py), t.north = std::min(t.north, field.height() - 2 - t.py);
}

// The plane of one triangle in double.
HWY_INLINE ExactPlane ExactPlaneOf(const HeightField& field, const Star& star, std::size_t i) {
  ExactPlane t;
  t.px = star.x, t.py = star.y;
  t.ux = star.ring.dx[i], t.uy = star.ring.dy[i], t.vx = star.ring.dx[i + 1], t.vy = star.ring.dy[i + 1];
  // Pairwise: std::min of a list would branch.
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

template <typename Found>
HWY_INLINE Found ScanWide(const HeightField& field, const PlaneFor<Found>& t) {
  return t.east - t.west < kMaxBoxVectors * LanesOf<typename Found::Tag>() ? ScanBox<Found>(field, t)
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
