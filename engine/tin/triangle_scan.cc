#include "engine/tin/triangle_scan.h"

#include <algorithm>
#include <array>
#include <bit>
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
using DoublesTag = hn::ScalableTag<double>;
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
template <typename Tag>
HWY_INLINE hn::Vec<Tag> From(Tag tag, int first) {
  return hn::Add(All(tag, first), hn::Iota(tag, 0));
}

// One triangle, seen from its last corner p.
struct ScannedTriangle {
  int px, py;
  double pz;
  double ux, uy, vx, vy;
  double d, a, b;                // D, A and B of the header
  int west, east, south, north;  // bounding box
};

// The furthest sample so far, lane by lane. Each lane meets its samples in row-major order, so that ">" keeps the
// first; no comparison with NaN holds.
template <typename Tag>
class Furthest {
 public:
  using Index = hn::Vec<IndexTag<Tag>>;

  HWY_INLINE Furthest() : numerator_(All(kTag, -1)), index_(hn::Zero(kIndices)) {}

  HWY_INLINE void Visit(hn::Vec<Tag> numerator, Index index, hn::Mask<Tag> inside) {
    Keep(hn::And(inside, hn::Gt(numerator, numerator_)), numerator, index);
  }
  HWY_INLINE void Visit(hn::Vec<Tag> numerator, Index index) { Keep(hn::Gt(numerator, numerator_), numerator, index); }

  // Of samples that were visited apart.
  HWY_INLINE void Merge(const Furthest& other) {
    const auto tied = hn::And(hn::Eq(other.numerator_, numerator_), hn::RebindMask(kTag, hn::Lt(other.index_, index_)));
    Keep(hn::Or(hn::Gt(other.numerator_, numerator_), tied), other.numerator_, other.index_);
  }

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

HWY_INLINE Floats HeightsAt(FloatsTag tag, const float* from) { return hn::LoadU(tag, from); }
HWY_INLINE hn::Vec<DoublesTag> HeightsAt(DoublesTag tag, const float* from) {
  return hn::PromoteTo(tag, hn::LoadU(hn::Rebind<float, DoublesTag>(), from));
}

// Barycentric coordinates times D of samples relative to p: integers, exact, also when stepped from row to row. Inside
// and on the edges none is negative.
template <typename Tag>
class Barycentric {
 public:
  HWY_INLINE Barycentric(const ScannedTriangle& t, hn::Vec<Tag> x, hn::Vec<Tag> y)
      : step_u_(All(kTag, t.vx)),
        step_v_(All(kTag, t.ux)),
        step_p_(hn::Sub(step_u_, step_v_)),
        of_u_(hn::Sub(hn::Mul(All(kTag, t.vy), x), hn::Mul(step_u_, y))),
        of_v_(hn::Sub(hn::Mul(step_v_, y), hn::Mul(All(kTag, t.uy), x))),
        of_p_(hn::Sub(All(kTag, t.d), hn::Add(of_u_, of_v_))) {}

  HWY_INLINE hn::Mask<Tag> IsInside() const { return hn::Ge(hn::Min(hn::Min(of_u_, of_v_), of_p_), hn::Zero(kTag)); }
  HWY_INLINE void Step() {
    of_u_ = hn::Sub(of_u_, step_u_);
    of_v_ = hn::Add(of_v_, step_v_);
    of_p_ = hn::Add(of_p_, step_p_);
  }

 private:
  static constexpr Tag kTag{};

  hn::Vec<Tag> step_u_, step_v_, step_p_;
  hn::Vec<Tag> of_u_, of_v_, of_p_;
};

// D times the distance of a vector of samples.
template <typename V>
HWY_INLINE V Numerator(V heights, V pz, V d, V plane) {
  return hn::Abs(hn::Sub(hn::Mul(d, hn::Sub(heights, pz)), plane));
}

// Every sample of some columns of the bounding box, masked: no spans, no divisions, no branches but the loop.
template <typename Tag>
HWY_INLINE Furthest<Tag> ScanColumns(Tag tag, const OpenSamples& samples, const ScannedTriangle& t, int column) {
  constexpr IndexTag<Tag> indices;
  const auto d = All(tag, t.d), pz = All(tag, t.pz), b = All(tag, t.b), one = All(tag, 1);
  const auto x = From(tag, column), a_x = hn::Mul(All(tag, t.a), x);
  auto y = All(tag, t.south);
  Barycentric<Tag> barycentric(t, x, y);
  const int width = samples.width(), first_row = t.py + t.south;
  const float* from = samples.Row(first_row) + t.px + column;
  const auto next_row = All(indices, width);
  auto index = From(indices, first_row * width + t.px + column);
  Furthest<Tag> furthest;
  for (int j = t.south; j <= t.north; ++j) {
    const auto numerator = Numerator(HeightsAt(tag, from), pz, d, hn::Add(a_x, hn::Mul(b, y)));
    furthest.Visit(numerator, index, barycentric.IsInside());
    from += width;
    index = hn::Add(index, next_row);
    y = hn::Add(y, one);
    barycentric.Step();
  }
  return furthest;
}

template <typename Tag>
HWY_INLINE Furthest<Tag> ScanBox(Tag tag, const OpenSamples& samples, const ScannedTriangle& t) {
  Furthest<Tag> furthest = ScanColumns(tag, samples, t, t.west);
  for (int column = t.west + LanesOf<Tag>(); column <= t.east; column += LanesOf<Tag>()) {
    furthest.Merge(ScanColumns(tag, samples, t, column));
  }
  return furthest;
}

// First or last columns of up to kRows rows, and what whole vectors spill.
constexpr int kRows = 64;
using Columns = std::array<std::int32_t, kRows + 16>;

// Where the edge from (x0, y0) to (x1, y1), y0 < y1, crosses the rows: x = n / dy with integers n = x0 dy + (y - y0)
// dx, rounded down, or up when dy - 1 is added to n. Exact with one multiplication: 0 <= n < 2^31 and dy < 2^15, so n *
// (1 / dy) is off by less than 2^-20 / dy, and a quotient that is no integer lies at least 1 / dy > 2^-15 below the
// next one: adding 2^-17 lifts an integer that was rounded down above itself, and lifts nothing else over an integer.
HWY_INLINE void Cross(int x0, int y0, int x1, int y1, bool round_up, int first_row, int rows, Columns& columns) {
  const hn::Rebind<std::int32_t, DoublesTag> ints;
  const int dy = y1 - y0;
  const int from = std::max(y0, first_row), to = std::min(y1, first_row + rows - 1);
  const auto inverse = All(kDoubles, 1.0 / dy), lift = All(kDoubles, 0x1p-17), slope = All(kDoubles, x1 - x0);
  const auto n0 = All(kDoubles, static_cast<double>(x0) * dy + (round_up ? dy - 1 : 0));
  for (int y = from; y <= to; y += LanesOf<DoublesTag>()) {
    const auto n = hn::Add(n0, hn::Mul(From(kDoubles, y - y0), slope));
    hn::StoreU(hn::DemoteTo(ints, hn::Add(hn::Mul(n, inverse), lift)), ints, columns.data() + (y - first_row));
  }
}

// Row by row, exact spans.
template <typename Tag>
HWY_INLINE Furthest<Tag> ScanSpans(Tag tag, const OpenSamples& samples, const ScannedTriangle& t) {
  std::array<int, 4> xs = {t.px, t.px + static_cast<int>(t.ux), t.px + static_cast<int>(t.vx), t.px};
  std::array<int, 4> ys = {t.py, t.py + static_cast<int>(t.uy), t.py + static_cast<int>(t.vy), t.py};
  const auto turn = [](std::array<int, 4>& values) { values = {values[1], values[2], values[3], values[1]}; };
  while (ys[0] > t.py + t.south) turn(xs), turn(ys);

  constexpr IndexTag<Tag> indices;
  const auto d = All(tag, t.d), a = All(tag, t.a), b = All(tag, t.b), pz = All(tag, t.pz);
  const int lanes = LanesOf<Tag>(), last_row = t.py + t.north, width = samples.width();
  const auto lanes_on = All(tag, lanes);
  const auto indices_on = All(indices, lanes);
  Furthest<Tag> furthest;
  Columns firsts, lasts;
  for (int block = t.py + t.south; block <= last_row; block += kRows) {
    const int rows = std::min(kRows, last_row - block + 1);
    // Counter-clockwise from the lowest corner: first up with the triangle on the west side, then down. Both sides from
    // the bottom, since whole vectors spill into the rows above. Where two edges meet, both give the corner's column.
    for (std::size_t i = 0; i < 3; ++i) {
      if (ys[i] < ys[i + 1]) Cross(xs[i], ys[i], xs[i + 1], ys[i + 1], false, block, rows, lasts);
    }
    for (std::size_t i = 3; i-- > 0;) {
      if (ys[i] > ys[i + 1]) Cross(xs[i + 1], ys[i + 1], xs[i], ys[i], true, block, rows, firsts);
    }
    for (int j = 0; j < rows; ++j) {
      const int first = firsts[static_cast<std::size_t>(j)], last = lasts[static_cast<std::size_t>(j)], y = block + j;
      const float* from = samples.Row(y) + first;
      const auto b_y = hn::Mul(b, All(tag, y - t.py));
      const auto end = All(indices, y * width + last + 1);
      auto x = From(tag, first - t.px);
      auto index = From(indices, y * width + first);
      int left = last - first + 1;
      for (; left >= lanes; left -= lanes) {
        furthest.Visit(Numerator(HeightsAt(tag, from), pz, d, hn::Add(hn::Mul(a, x), b_y)), index);
        from += lanes;
        x = hn::Add(x, lanes_on);
        index = hn::Add(index, indices_on);
      }
      if (left <= 0) continue;
      const auto inside = hn::RebindMask(tag, hn::Lt(index, end));
      furthest.Visit(Numerator(HeightsAt(tag, from), pz, d, hn::Add(hn::Mul(a, x), b_y)), index, inside);
    }
  }
  return furthest;
}

// ScannedTriangle's numbers from the ring, one by one.
HWY_INLINE ScannedTriangle TriangleOf(const Star& star, std::size_t i) {
  const int ux = star.ring.dx[i], uy = star.ring.dy[i], vx = star.ring.dx[i + 1], vy = star.ring.dy[i + 1];
  const double pz = static_cast<double>(star.height);
  const double uz = static_cast<double>(star.ring.heights[i]) - pz;
  const double vz = static_cast<double>(star.ring.heights[i + 1]) - pz;
  ScannedTriangle t;
  t.px = star.x, t.py = star.y, t.pz = pz;
  t.ux = ux, t.uy = uy, t.vx = vx, t.vy = vy;
  t.d = t.ux * t.vy - t.uy * t.vx;
  t.a = t.vy * uz - t.uy * vz;
  t.b = t.ux * vz - t.vx * uz;
  t.west = std::min({ux, vx, 0}), t.east = std::max({ux, vx, 0});
  t.south = std::min({uy, vy, 0}), t.north = std::max({uy, vy, 0});
  return t;
}

// Up to so many vectors of columns the box is quicker than its spans.
constexpr int kMostBoxVectors = 2;

template <typename Tag>
HWY_INLINE Furthest<Tag> ScanWide(Tag tag, const OpenSamples& samples, const ScannedTriangle& t) {
  return t.east - t.west < kMostBoxVectors * LanesOf<Tag>() ? ScanBox(tag, samples, t) : ScanSpans(tag, samples, t);
}

PlaneMisfit ScanExactly(const OpenSamples& samples, const Star& star, std::size_t i) {
  const ScannedTriangle t = TriangleOf(star, i);
  const Furthest<DoublesTag> furthest = ScanWide(kDoubles, samples, t);
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

// What the triangles of a star need, for as many of them at once as there are lanes.
struct StarPlanes {
  static constexpr std::size_t kMost = hn::MaxLanes(kFloats);

  HWY_INLINE void Work(const Star& star, std::size_t first) {
    const std::int32_t *dx = star.ring.dx.data() + first, *dy = star.ring.dy.data() + first;
    const float* heights = star.ring.heights.data() + first;
    const auto u_x = hn::LoadU(kInts, dx), v_x = hn::LoadU(kInts, dx + 1), none = hn::Zero(kInts);
    const auto u_y = hn::LoadU(kInts, dy), v_y = hn::LoadU(kInts, dy + 1);
    const Floats pz = All(kFloats, star.height);
    const Floats u_z = hn::Sub(hn::LoadU(kFloats, heights), pz), v_z = hn::Sub(hn::LoadU(kFloats, heights + 1), pz);
    const Floats of_ux = hn::ConvertTo(kFloats, u_x), of_uy = hn::ConvertTo(kFloats, u_y);
    const Floats of_vx = hn::ConvertTo(kFloats, v_x), of_vy = hn::ConvertTo(kFloats, v_y);
    hn::Store(of_ux, kFloats, ux);
    hn::Store(of_uy, kFloats, uy);
    hn::Store(of_vx, kFloats, vx);
    hn::Store(of_vy, kFloats, vy);
    hn::Store(hn::Sub(hn::Mul(of_ux, of_vy), hn::Mul(of_uy, of_vx)), kFloats, d);
    const Floats vy_uz = hn::Mul(of_vy, u_z), uy_vz = hn::Mul(of_uy, v_z);
    const Floats ux_vz = hn::Mul(of_ux, v_z), vx_uz = hn::Mul(of_vx, u_z);
    const Floats of_a = hn::Sub(vy_uz, uy_vz), of_b = hn::Sub(ux_vz, vx_uz);
    hn::Store(of_a, kFloats, a);
    hn::Store(of_b, kFloats, b);
    const auto low_x = hn::Min(hn::Min(u_x, v_x), none), high_x = hn::Max(hn::Max(u_x, v_x), none);
    const auto low_y = hn::Min(hn::Min(u_y, v_y), none), high_y = hn::Max(hn::Max(u_y, v_y), none);
    hn::Store(low_x, kInts, west);
    hn::Store(low_y, kInts, south);
    hn::Store(hn::Max(hn::Sub(high_x, low_x), hn::Sub(high_y, low_y)), kInts, extent);
    // No column or row of the triangle is further from p than its box is wide or high.
    const Floats across = hn::ConvertTo(kFloats, hn::Sub(high_x, low_x)),
                 up = hn::ConvertTo(kFloats, hn::Sub(high_y, low_y));
    const Floats products = hn::Add(hn::Max(hn::Abs(vy_uz), hn::Abs(uy_vz)), hn::Max(hn::Abs(ux_vz), hn::Abs(vx_uz)));
    const Floats most_plane = hn::Add(hn::Mul(hn::Abs(of_a), across), hn::Mul(hn::Abs(of_b), up));
    hn::Store(hn::Add(products, most_plane), kFloats, largest);
  }

  HWY_ALIGN float ux[kMost], uy[kMost], vx[kMost], vy[kMost], d[kMost], a[kMost], b[kMost];
  HWY_ALIGN float largest[kMost];                                   // no product or sum of the planes' is larger
  HWY_ALIGN std::int32_t west[kMost], south[kMost], extent[kMost];  // bounding box: its first sample, its larger side
};

// Doubled areas, and what barycentric coordinates are computed from, stay below 2^24.
constexpr int kMostExtent = 2048;

struct QuickMisfit {
  float numerator = -1;
  std::uint32_t sample = kNoSample;
};

// One block, from (west, south) relative to p. No branch: which triangle lies where in its block cannot be foretold.
template <int kSide>
HWY_INLINE QuickMisfit ScanBlock(const OpenSamples& samples, const Star& star, const StarPlanes& planes, std::size_t i,
                                 int west, int south) {
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloats)), kRowsAtOnce = kLanes / kSide;
  constexpr int kVectors = kSide * kSide / kLanes;
  const Floats columns = hn::Load(kFloats, kSide == 4 ? kColumnsBy4 : kColumnsBy8);
  const Floats rows = hn::Load(kFloats, kSide == 4 ? kRowsBy4 : kRowsBy8);
  const Floats x = hn::Add(All(kFloats, west), columns);
  Floats y = hn::Add(All(kFloats, south), rows);
  const Floats ux = All(kFloats, planes.ux[i]), uy = All(kFloats, planes.uy[i]), vx = All(kFloats, planes.vx[i]),
               vy = All(kFloats, planes.vy[i]);
  const Floats d = All(kFloats, planes.d[i]), b = All(kFloats, planes.b[i]), pz = All(kFloats, star.height);
  const Floats a_x = hn::Mul(All(kFloats, planes.a[i]), x);
  Floats of_u = hn::Sub(hn::Mul(vy, x), hn::Mul(vx, y)), of_v = hn::Sub(hn::Mul(ux, y), hn::Mul(uy, x));
  Floats of_p = hn::Sub(d, hn::Add(of_u, of_v));
  const Floats at_once = All(kFloats, kRowsAtOnce);
  const Floats step_u = hn::Mul(vx, at_once), step_v = hn::Mul(ux, at_once), step_p = hn::Sub(step_u, step_v);

  const Floats none = All(kFloats, -1), zero = hn::Zero(kFloats);
  const int width = samples.width();
  const float* const from = samples.Row(star.y + south) + star.x + west;
  HWY_ALIGN float numerators[kSide * kSide];
  Floats most = none;
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    const Floats heights = RowsFrom<kSide>(from + k * kRowsAtOnce * width, width);
    const Floats numerator = hn::Abs(hn::Sub(hn::Mul(d, hn::Sub(heights, pz)), hn::Add(a_x, hn::Mul(b, y))));
    const auto inside = hn::Ge(hn::Min(hn::Min(of_u, of_v), of_p), zero);
    const Floats counted = hn::IfThenElse(hn::And(inside, hn::Ge(numerator, zero)), numerator, none);
    hn::Store(counted, kFloats, numerators + k * kLanes);
    most = hn::Max(most, counted);
    y = hn::Add(y, at_once);
    of_u = hn::Sub(of_u, step_u);
    of_v = hn::Add(of_v, step_v);
    of_p = hn::Add(of_p, step_p);
  }
  most = hn::MaxOfLanes(kFloats, most);
  std::uint64_t found = 0;
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    std::uint16_t bits = 0;
    hn::StoreMaskBits(kFloats, hn::Eq(hn::Load(kFloats, numerators + k * kLanes), most),
                      reinterpret_cast<std::uint8_t*>(&bits));
    found |= std::uint64_t{bits} << (k * kLanes);
  }
  const int first = std::countr_zero(found);
  const int sample = (star.y + south + first / kSide) * width + star.x + west + first % kSide;
  return {hn::GetLane(most), static_cast<std::uint32_t>(sample)};
}

HWY_INLINE QuickMisfit ScanInFloats(const OpenSamples& samples, const Star& star, const StarPlanes& planes,
                                    std::size_t i, std::size_t first) {
  const int extent = planes.extent[i];
  if (extent < 4) return ScanBlock<4>(samples, star, planes, i, planes.west[i], planes.south[i]);
  if (extent < kLargeSide) return ScanBlock<kLargeSide>(samples, star, planes, i, planes.west[i], planes.south[i]);
  const Furthest<FloatsTag> furthest = ScanWide(kFloats, samples, TriangleOf(star, first + i));
  return {furthest.numerator(), furthest.sample()};
}

HWY_INLINE PlaneMisfit ScanQuickly(const OpenSamples& samples, const Star& star, const StarPlanes& planes,
                                   std::size_t i, std::size_t first, float most_exact) {
  if (planes.d[i] == 1) return {};  // Pick's theorem: no sample but its corners
  const QuickMisfit quick = ScanInFloats(samples, star, planes, i, first);
  if (quick.numerator < 0) return {};
  if (!(quick.numerator + planes.largest[i] < most_exact)) return ScanExactly(samples, star, first + i);
  return {static_cast<double>(quick.numerator) / static_cast<double>(planes.d[i]), quick.sample};
}

#endif

}  // namespace

void ScanStar(const OpenSamples& samples, const Star& star, PlaneMisfit* misfits) {
#if HWY_TARGET == HWY_SCALAR
  for (std::size_t i = 0; i < star.count; ++i) misfits[i] = ScanExactly(samples, star, i);
#else
  StarPlanes planes;
  const std::size_t lanes = hn::Lanes(kFloats);
  const float most_exact = samples.quantum() * 0xFFFF00;
  for (std::size_t first = 0; first < star.count; first += lanes) {
    planes.Work(star, first);
    const std::size_t count = std::min(lanes, star.count - first);
    for (std::size_t i = 0; i < count; ++i) {
      misfits[first + i] = planes.extent[i] <= kMostExtent && planes.largest[i] < most_exact
                               ? ScanQuickly(samples, star, planes, i, first, most_exact)
                               : ScanExactly(samples, star, first + i);
    }
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
