#include "engine/tin/triangle_scan.h"

#include <algorithm>
#include <array>
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
  double d, a, b;                 // D, A and B of the header
  int west, east, south, north;  // bounding box
};

// The furthest sample so far, lane by lane. Each lane meets its samples in row-major order, so that ">" keeps the first;
// no comparison with NaN holds.
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

// Four columns of one row, or of two where a vector takes them.
HWY_INLINE Doubles FourColumnsAt(const float* from, int stride) {
#if HWY_MAX_BYTES >= 64
  const hn::Half<decltype(kFloats)> row;
  return hn::PromoteTo(kDoubles, hn::Combine(kFloats, hn::LoadU(row, from + stride), hn::LoadU(row, from)));
#else
  static_cast<void>(stride);
  return HeightsAt(from);
#endif
}

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

// A bounding box of up to 4 x 4 samples, most of them once a mesh is fine: no branch at all.
HWY_INLINE PlaneMisfit ScanSmallBox(const OpenSamples& samples, const ScannedTriangle& t) {
  constexpr int kSide = 4;
  const int rows = Lanes() / kSide;  // at once
  HWY_ALIGN static constexpr double kColumn[8] = {0, 1, 2, 3, 0, 1, 2, 3}, kRow[8] = {0, 0, 0, 0, 1, 1, 1, 1};
  const Doubles column = hn::Load(kDoubles, kColumn), row = hn::Load(kDoubles, kRow);
  const Doubles d = All(t.d), pz = All(t.pz), b = All(t.b);
  const Doubles x = hn::Add(All(t.west), column), a_x = hn::Mul(All(t.a), x);
  Doubles y = hn::Add(All(t.south), row);
  Barycentric barycentric(t, x, y, rows);
  const double width = samples.width();
  Doubles index = hn::Add(hn::Add(All((t.py + t.south) * width + (t.px + t.west)), column), hn::Mul(row, All(width)));
  const float* from = samples.Row(t.py + t.south) + t.px + t.west;
  Furthest furthest;
  for (int j = 0; j < kSide; j += rows) {
    const Doubles heights = FourColumnsAt(from, samples.width());
    furthest.Visit(Numerator(heights, pz, d, hn::Add(a_x, hn::Mul(b, y))), index, barycentric.IsInside());
    from += rows * samples.width();
    index = hn::Add(index, All(rows * width));
    y = hn::Add(y, All(rows));
    barycentric.Step();
  }
  return furthest.Of(t.d);
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

// Where the edge from (x0, y0) to (x1, y1), y0 < y1, crosses the rows: x = n / dy with integers n = x0 dy + (y - y0) dx,
// rounded down, or up when dy - 1 is added to n. Exact with one multiplication: 0 <= n < 2^31 and dy < 2^15, so
// n * (1 / dy) is off by less than 2^-20 / dy, and a quotient that is no integer lies at least 1 / dy > 2^-15 below the
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

// What the triangles of a star need, for as many of them at once as there are lanes.
struct StarPlanes {
  static constexpr std::size_t kMost = hn::MaxLanes(kDoubles);

  HWY_INLINE void Work(const Star& star, std::size_t first) {
    const std::int32_t *dx = star.ring.dx.data() + first, *dy = star.ring.dy.data() + first;
    const float* heights = star.ring.heights.data() + first;
    const auto u_x = hn::LoadU(kInts, dx), v_x = hn::LoadU(kInts, dx + 1), none = hn::Zero(kInts);
    const auto u_y = hn::LoadU(kInts, dy), v_y = hn::LoadU(kInts, dy + 1);
    const Doubles pz = All(static_cast<double>(star.height));
    const Doubles u_z = hn::Sub(HeightsAt(heights), pz), v_z = hn::Sub(HeightsAt(heights + 1), pz);
    const Doubles ux_d = hn::PromoteTo(kDoubles, u_x), uy_d = hn::PromoteTo(kDoubles, u_y);
    const Doubles vx_d = hn::PromoteTo(kDoubles, v_x), vy_d = hn::PromoteTo(kDoubles, v_y);
    hn::Store(ux_d, kDoubles, ux);
    hn::Store(uy_d, kDoubles, uy);
    hn::Store(vx_d, kDoubles, vx);
    hn::Store(vy_d, kDoubles, vy);
    hn::Store(hn::Sub(hn::Mul(ux_d, vy_d), hn::Mul(uy_d, vx_d)), kDoubles, d);
    hn::Store(hn::Sub(hn::Mul(vy_d, u_z), hn::Mul(uy_d, v_z)), kDoubles, a);
    hn::Store(hn::Sub(hn::Mul(ux_d, v_z), hn::Mul(vx_d, u_z)), kDoubles, b);
    hn::Store(hn::Min(hn::Min(u_x, v_x), none), kInts, west);
    hn::Store(hn::Max(hn::Max(u_x, v_x), none), kInts, east);
    hn::Store(hn::Min(hn::Min(u_y, v_y), none), kInts, south);
    hn::Store(hn::Max(hn::Max(u_y, v_y), none), kInts, north);
  }

  HWY_ALIGN double ux[kMost], uy[kMost], vx[kMost], vy[kMost], d[kMost], a[kMost], b[kMost];
  HWY_ALIGN std::int32_t west[kMost], east[kMost], south[kMost], north[kMost];
};

}  // namespace

void ScanStar(const OpenSamples& samples, const Star& star, PlaneMisfit* misfits) {
  StarPlanes planes;
  const auto lanes = static_cast<std::size_t>(Lanes());
  for (std::size_t first = 0; first < star.count; first += lanes) {
    planes.Work(star, first);
    const std::size_t count = std::min(lanes, star.count - first);
    for (std::size_t i = 0; i < count; ++i) {
      PlaneMisfit& misfit = misfits[first + i];
      if (planes.d[i] == 1) {  // Pick's theorem: no sample but its corners
        misfit = {};
        continue;
      }
      const ScannedTriangle t = {star.x,      star.y,      static_cast<double>(star.height),
                                 planes.ux[i], planes.uy[i], planes.vx[i],
                                 planes.vy[i], planes.d[i],  planes.a[i],
                                 planes.b[i],  planes.west[i], planes.east[i],
                                 planes.south[i], planes.north[i]};
      const int across = t.east - t.west;
      if (lanes >= 4 && across < 4 && t.north - t.south < 4) {
        misfit = ScanSmallBox(samples, t);
      } else if (across < 2 * Lanes()) {  // up to two vectors of columns the box is quicker than its spans
        misfit = ScanBox(samples, t);
      } else {
        misfit = ScanSpans(samples, t);
      }
    }
  }
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
