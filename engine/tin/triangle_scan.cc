#include "engine/tin/triangle_scan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/tin/triangle_scan.cc"
#include <hwy/foreach_target.h>  // includes this file once for each set of instructions
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace terrace::tin {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

const hn::ScalableTag<double> kDoubles;
const hn::Rebind<float, decltype(kDoubles)> kFloats;
const hn::Rebind<std::int32_t, decltype(kDoubles)> kInts;
using Doubles = hn::Vec<decltype(kDoubles)>;
using Inside = hn::Mask<decltype(kDoubles)>;

HWY_INLINE int Lanes() { return static_cast<int>(hn::Lanes(kDoubles)); }
HWY_INLINE Doubles All(double value) { return hn::Set(kDoubles, value); }

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
class Furthest {
 public:
  HWY_INLINE Furthest() : numerator_(All(-1.0)), index_(hn::Zero(kDoubles)) {}

  HWY_INLINE void Visit(Doubles numerator, Doubles index, Inside inside) {
    const Inside further = hn::And(inside, hn::Gt(numerator, numerator_));
    numerator_ = hn::IfThenElse(further, numerator, numerator_);
    index_ = hn::IfThenElse(further, index, index_);
  }
  HWY_INLINE void Visit(Doubles numerator, Doubles index) {
    const Inside further = hn::Gt(numerator, numerator_);
    numerator_ = hn::IfThenElse(further, numerator, numerator_);
    index_ = hn::IfThenElse(further, index, index_);
  }

  // Of samples that were visited apart.
  HWY_INLINE void Merge(const Furthest& other) {
    const Inside further = hn::Gt(other.numerator_, numerator_);
    const Inside tied = hn::And(hn::Eq(other.numerator_, numerator_), hn::Lt(other.index_, index_));
    numerator_ = hn::Max(numerator_, other.numerator_);
    index_ = hn::IfThenElse(hn::Or(further, tied), other.index_, index_);
  }

  HWY_INLINE PlaneMisfit Of(double d) const {
    const Doubles most = hn::MaxOfLanes(kDoubles, numerator_);
    const double numerator = hn::GetLane(most);
    if (numerator < 0) return {};
    const Doubles none = All(std::numeric_limits<double>::infinity());
    const Doubles first = hn::MinOfLanes(kDoubles, hn::IfThenElse(hn::Eq(numerator_, most), index_, none));
    return {numerator / d, static_cast<std::uint32_t>(static_cast<std::int64_t>(hn::GetLane(first)))};
  }

 private:
  Doubles numerator_;  // D times the distance
  Doubles index_;      // row-major, exact
};

HWY_INLINE Doubles HeightsAt(const float* from) { return hn::PromoteTo(kDoubles, hn::LoadU(kFloats, from)); }

// Barycentric coordinates times D of samples relative to p: integers, exact, also when stepped from row to row. Inside
// and on the edges none is negative.
class Barycentric {
 public:
  HWY_INLINE Barycentric(const ScannedTriangle& t, Doubles x, Doubles y, double rows)
      : of_u_(hn::Sub(hn::Mul(All(t.vy), x), hn::Mul(All(t.vx), y))),
        of_v_(hn::Sub(hn::Mul(All(t.ux), y), hn::Mul(All(t.uy), x))),
        of_p_(hn::Sub(All(t.d), hn::Add(of_u_, of_v_))),
        step_u_(All(t.vx * rows)),
        step_v_(All(t.ux * rows)),
        step_p_(hn::Sub(step_u_, step_v_)) {}

  HWY_INLINE Inside IsInside() const { return hn::Ge(hn::Min(hn::Min(of_u_, of_v_), of_p_), hn::Zero(kDoubles)); }
  HWY_INLINE void Step() {
    of_u_ = hn::Sub(of_u_, step_u_);
    of_v_ = hn::Add(of_v_, step_v_);
    of_p_ = hn::Add(of_p_, step_p_);
  }

 private:
  Doubles of_u_, of_v_, of_p_;
  Doubles step_u_, step_v_, step_p_;
};

// D times the distance of the samples of one row or two.
HWY_INLINE Doubles Numerator(Doubles heights, Doubles pz, Doubles d, Doubles plane) {
  return hn::Abs(hn::Sub(hn::Mul(d, hn::Sub(heights, pz)), plane));
}

// Every sample of some columns of the bounding box, masked: no spans, no divisions, no branches but the loop.
HWY_INLINE Furthest ScanColumns(const OpenSamples& samples, const ScannedTriangle& t, int column) {
  const Doubles d = All(t.d), pz = All(t.pz), b = All(t.b), one = All(1.0), width = All(samples.width());
  const Doubles x = hn::Iota(kDoubles, column), a_x = hn::Mul(All(t.a), x);
  Doubles y = All(t.south);
  Barycentric barycentric(t, x, y, 1);
  const int first_row = t.py + t.south;
  const float* from = samples.Row(first_row) + t.px + column;
  Doubles index = hn::Iota(kDoubles, static_cast<double>(first_row) * samples.width() + t.px + column);
  Furthest furthest;
  for (int j = t.south; j <= t.north; ++j) {
    furthest.Visit(Numerator(HeightsAt(from), pz, d, hn::Add(a_x, hn::Mul(b, y))), index, barycentric.IsInside());
    from += samples.width();
    index = hn::Add(index, width);
    y = hn::Add(y, one);
    barycentric.Step();
  }
  return furthest;
}

HWY_INLINE PlaneMisfit ScanBox(const OpenSamples& samples, const ScannedTriangle& t) {
  Furthest furthest = ScanColumns(samples, t, t.west);
  for (int column = t.west + Lanes(); column <= t.east; column += Lanes()) {
    furthest.Merge(ScanColumns(samples, t, column));
  }
  return furthest.Of(t.d);
}

// First or last columns of up to kRows rows, and what whole vectors spill.
constexpr int kRows = 64;
using Columns = std::array<std::int32_t, kRows + 16>;

// Where the edge from (x0, y0) to (x1, y1), y0 < y1, crosses the rows: x = n / dy with integers n = x0 dy + (y - y0)
// dx, rounded down, or up when dy - 1 is added to n. Exact with one multiplication: 0 <= n < 2^31 and dy < 2^15, so n *
// (1 / dy) is off by less than 2^-20 / dy, and a quotient that is no integer lies at least 1 / dy > 2^-15 below the
// next one: adding 2^-17 lifts an integer that was rounded down above itself, and lifts nothing else over an integer.
HWY_INLINE void Cross(int x0, int y0, int x1, int y1, bool round_up, int first_row, int rows, Columns& columns) {
  const int dy = y1 - y0;
  const int from = std::max(y0, first_row), to = std::min(y1, first_row + rows - 1);
  const Doubles inverse = All(1.0 / dy), lift = All(0x1p-17), slope = All(x1 - x0);
  const Doubles n0 = All(static_cast<double>(x0) * dy + (round_up ? dy - 1 : 0));
  for (int y = from; y <= to; y += Lanes()) {
    const Doubles n = hn::Add(n0, hn::Mul(hn::Iota(kDoubles, y - y0), slope));
    hn::StoreU(hn::DemoteTo(kInts, hn::Add(hn::Mul(n, inverse), lift)), kInts, columns.data() + (y - first_row));
  }
}

// Row by row, exact spans.
HWY_INLINE PlaneMisfit ScanSpans(const OpenSamples& samples, const ScannedTriangle& t) {
  std::array<int, 4> xs = {t.px, t.px + static_cast<int>(t.ux), t.px + static_cast<int>(t.vx), t.px};
  std::array<int, 4> ys = {t.py, t.py + static_cast<int>(t.uy), t.py + static_cast<int>(t.vy), t.py};
  const auto turn = [](std::array<int, 4>& values) { values = {values[1], values[2], values[3], values[1]}; };
  while (ys[0] > t.py + t.south) turn(xs), turn(ys);

  const Doubles d = All(t.d), a = All(t.a), pz = All(t.pz), steps = hn::Iota(kDoubles, 0.0);
  const int lanes = Lanes(), last_row = t.py + t.north;
  Furthest furthest;
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
      const Doubles b_y = All(t.b * (y - t.py)), end = All(static_cast<double>(y) * samples.width() + last);
      Doubles x = hn::Add(All(first - t.px), steps);
      Doubles index = hn::Add(All(static_cast<double>(y) * samples.width() + first), steps);
      int left = last - first + 1;
      for (; left >= lanes; left -= lanes) {
        furthest.Visit(Numerator(HeightsAt(from), pz, d, hn::Add(hn::Mul(a, x), b_y)), index);
        from += lanes;
        x = hn::Add(x, All(lanes));
        index = hn::Add(index, All(lanes));
      }
      if (left <= 0) continue;
      const Inside inside = hn::Le(index, end);
      furthest.Visit(Numerator(HeightsAt(from), pz, d, hn::Add(hn::Mul(a, x), b_y)), index, inside);
    }
  }
  return furthest.Of(t.d);
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

HWY_INLINE PlaneMisfit ScanExactly(const OpenSamples& samples, const Star& star, std::size_t i) {
  const ScannedTriangle t = TriangleOf(star, i);
  // Up to two vectors of columns the box is quicker than its spans.
  return t.east - t.west < 2 * Lanes() ? ScanBox(samples, t) : ScanSpans(samples, t);
}

#if HWY_TARGET != HWY_SCALAR

// Small triangles are scanned in single precision, which is exact there most of the time: all heights are multiples of
// a quantum (OpenSamples::quantum), so all that the formula adds and multiplies is, and every multiple up to 2^24 times
// the quantum is a float. Where that bound may be exceeded, the triangle is scanned in double precision instead.
const hn::CappedTag<float, 16> kQuick;
using Quick = hn::Vec<decltype(kQuick)>;
const hn::RebindToSigned<decltype(kQuick)> kQuickInts;

HWY_INLINE Quick Every(float value) { return hn::Set(kQuick, value); }
HWY_INLINE Quick Magnitude(Quick value) { return hn::Abs(value); }

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
HWY_INLINE Quick RowsFrom(const float* from, int stride) {
  constexpr int kRowsAtOnce = static_cast<int>(hn::MaxLanes(kQuick)) / kSide;
  if constexpr (kRowsAtOnce == 1) {
    static_cast<void>(stride);
    return hn::LoadU(kQuick, from);
  } else if constexpr (kRowsAtOnce == 2) {
    const hn::Half<decltype(kQuick)> row;
    return hn::Combine(kQuick, hn::LoadU(row, from + stride), hn::LoadU(row, from));
  } else {
    const hn::Half<decltype(kQuick)> two;
    const hn::Half<decltype(two)> row;
    return hn::Combine(kQuick,
                       hn::Combine(two, hn::LoadU(row, from + 3 * stride), hn::LoadU(row, from + 2 * stride)),
                       hn::Combine(two, hn::LoadU(row, from + stride), hn::LoadU(row, from)));
  }
}

// What the triangles of a star need, for as many of them at once as there are lanes.
struct StarPlanes {
  static constexpr std::size_t kMost = hn::MaxLanes(kQuick);

  HWY_INLINE void Work(const Star& star, std::size_t first) {
    const std::int32_t *dx = star.ring.dx.data() + first, *dy = star.ring.dy.data() + first;
    const float* heights = star.ring.heights.data() + first;
    const auto u_x = hn::LoadU(kQuickInts, dx), v_x = hn::LoadU(kQuickInts, dx + 1), none = hn::Zero(kQuickInts);
    const auto u_y = hn::LoadU(kQuickInts, dy), v_y = hn::LoadU(kQuickInts, dy + 1);
    const Quick pz = Every(star.height);
    const Quick u_z = hn::Sub(hn::LoadU(kQuick, heights), pz), v_z = hn::Sub(hn::LoadU(kQuick, heights + 1), pz);
    const Quick of_ux = hn::ConvertTo(kQuick, u_x), of_uy = hn::ConvertTo(kQuick, u_y);
    const Quick of_vx = hn::ConvertTo(kQuick, v_x), of_vy = hn::ConvertTo(kQuick, v_y);
    hn::Store(of_ux, kQuick, ux);
    hn::Store(of_uy, kQuick, uy);
    hn::Store(of_vx, kQuick, vx);
    hn::Store(of_vy, kQuick, vy);
    hn::Store(hn::Sub(hn::Mul(of_ux, of_vy), hn::Mul(of_uy, of_vx)), kQuick, d);
    const Quick vy_uz = hn::Mul(of_vy, u_z), uy_vz = hn::Mul(of_uy, v_z);
    const Quick ux_vz = hn::Mul(of_ux, v_z), vx_uz = hn::Mul(of_vx, u_z);
    const Quick of_a = hn::Sub(vy_uz, uy_vz), of_b = hn::Sub(ux_vz, vx_uz);
    hn::Store(of_a, kQuick, a);
    hn::Store(of_b, kQuick, b);
    const auto low_x = hn::Min(hn::Min(u_x, v_x), none), high_x = hn::Max(hn::Max(u_x, v_x), none);
    const auto low_y = hn::Min(hn::Min(u_y, v_y), none), high_y = hn::Max(hn::Max(u_y, v_y), none);
    hn::Store(low_x, kQuickInts, west);
    hn::Store(low_y, kQuickInts, south);
    hn::Store(hn::Max(hn::Sub(high_x, low_x), hn::Sub(high_y, low_y)), kQuickInts, extent);
    // No column or row of the triangle is further from p than its box is wide or high.
    const Quick across = hn::ConvertTo(kQuick, hn::Sub(high_x, low_x)), up = hn::ConvertTo(kQuick, hn::Sub(high_y, low_y));
    const Quick products = hn::Add(hn::Max(Magnitude(vy_uz), Magnitude(uy_vz)), hn::Max(Magnitude(ux_vz), Magnitude(vx_uz)));
    const Quick most_plane = hn::Add(hn::Mul(Magnitude(of_a), across), hn::Mul(Magnitude(of_b), up));
    hn::Store(hn::Add(products, most_plane), kQuick, largest);
  }

  HWY_ALIGN float ux[kMost], uy[kMost], vx[kMost], vy[kMost], d[kMost], a[kMost], b[kMost];
  HWY_ALIGN float largest[kMost];                                  // no product or sum of the planes' is larger
  HWY_ALIGN std::int32_t west[kMost], south[kMost], extent[kMost];  // bounding box: its first sample, its larger side
};

struct QuickMisfit {
  float numerator = -1;
  std::uint32_t sample = kNoSample;
};

// One block, from (west, south) relative to p. No branch: which triangle lies where in its block cannot be foretold.
template <int kSide>
HWY_INLINE QuickMisfit ScanBlock(const OpenSamples& samples, const Star& star, const StarPlanes& planes, std::size_t i,
                                 int west, int south) {
  constexpr int kLanes = static_cast<int>(hn::MaxLanes(kQuick)), kRowsAtOnce = kLanes / kSide;
  constexpr int kVectors = kSide * kSide / kLanes;
  const Quick columns = hn::Load(kQuick, kSide == 4 ? kColumnsBy4 : kColumnsBy8);
  const Quick rows = hn::Load(kQuick, kSide == 4 ? kRowsBy4 : kRowsBy8);
  const Quick x = hn::Add(Every(static_cast<float>(west)), columns);
  Quick y = hn::Add(Every(static_cast<float>(south)), rows);
  const Quick ux = Every(planes.ux[i]), uy = Every(planes.uy[i]), vx = Every(planes.vx[i]), vy = Every(planes.vy[i]);
  const Quick d = Every(planes.d[i]), b = Every(planes.b[i]), pz = Every(star.height);
  const Quick a_x = hn::Mul(Every(planes.a[i]), x);
  Quick of_u = hn::Sub(hn::Mul(vy, x), hn::Mul(vx, y)), of_v = hn::Sub(hn::Mul(ux, y), hn::Mul(uy, x));
  Quick of_p = hn::Sub(d, hn::Add(of_u, of_v));
  const Quick at_once = Every(static_cast<float>(kRowsAtOnce));
  const Quick step_u = hn::Mul(vx, at_once), step_v = hn::Mul(ux, at_once), step_p = hn::Sub(step_u, step_v);

  const Quick none = Every(-1.0F), zero = hn::Zero(kQuick);
  const int width = samples.width();
  const float* const from = samples.Row(star.y + south) + star.x + west;
  HWY_ALIGN float numerators[kSide * kSide];
  Quick most = none;
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    const Quick heights = RowsFrom<kSide>(from + k * kRowsAtOnce * width, width);
    const Quick numerator = hn::Abs(hn::Sub(hn::Mul(d, hn::Sub(heights, pz)), hn::Add(a_x, hn::Mul(b, y))));
    const auto inside = hn::Ge(hn::Min(hn::Min(of_u, of_v), of_p), zero);
    const Quick counted = hn::IfThenElse(hn::And(inside, hn::Ge(numerator, zero)), numerator, none);
    hn::Store(counted, kQuick, numerators + k * kLanes);
    most = hn::Max(most, counted);
    y = hn::Add(y, at_once);
    of_u = hn::Sub(of_u, step_u);
    of_v = hn::Add(of_v, step_v);
    of_p = hn::Add(of_p, step_p);
  }
  most = hn::MaxOfLanes(kQuick, most);
  std::uint64_t found = 0;
#pragma GCC unroll 8
  for (int k = 0; k < kVectors; ++k) {
    std::uint16_t bits = 0;
    hn::StoreMaskBits(kQuick, hn::Eq(hn::Load(kQuick, numerators + k * kLanes), most),
                      reinterpret_cast<std::uint8_t*>(&bits));
    found |= std::uint64_t{bits} << (k * kLanes);
  }
  const int first = std::countr_zero(found);
  const int sample = (star.y + south + first / kSide) * width + star.x + west + first % kSide;
  return {hn::GetLane(most), static_cast<std::uint32_t>(sample)};
}

HWY_INLINE QuickMisfit ScanBlocks(const OpenSamples& samples, const Star& star, const StarPlanes& planes,
                                  std::size_t i) {
  const int west = planes.west[i], south = planes.south[i], extent = planes.extent[i];
  if (extent < 4) return ScanBlock<4>(samples, star, planes, i, west, south);
  QuickMisfit misfit;
  for (int row = south; row <= south + extent; row += kLargeSide) {
    for (int column = west; column <= west + extent; column += kLargeSide) {
      const QuickMisfit other = ScanBlock<kLargeSide>(samples, star, planes, i, column, row);
      const bool precedes = other.numerator > misfit.numerator ||
                            (other.numerator == misfit.numerator && other.sample < misfit.sample);
      if (precedes) misfit = other;
    }
  }
  return misfit;
}

HWY_INLINE PlaneMisfit ScanQuickly(const OpenSamples& samples, const Star& star, const StarPlanes& planes,
                                   std::size_t i, std::size_t first, float most_exact) {
  if (planes.d[i] == 1) return {};  // Pick's theorem: no sample but its corners
  const QuickMisfit quick = ScanBlocks(samples, star, planes, i);
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
  const std::size_t lanes = hn::Lanes(kQuick);
  const float most_exact = samples.quantum() * 0xFFFF00;
  for (std::size_t first = 0; first < star.count; first += lanes) {
    planes.Work(star, first);
    const std::size_t count = std::min(lanes, star.count - first);
    for (std::size_t i = 0; i < count; ++i) {
      misfits[first + i] = planes.extent[i] < 2 * kLargeSide && planes.largest[i] < most_exact
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
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return HWY_DYNAMIC_DISPATCH(ScanStar);
}

}  // namespace terrace::tin
#endif
