// The two ways to divide a convex quadrilateral into two triangles: their shape quality and the angle between their
// normals.
//
//        w           The quadrilateral (p, u, w, v), counter-clockwise, seen from the point p that is being inserted.
//       / \          It is cut by u-v into (u, v, p) and (v, u, w), or by p-w into (u, w, p) and (w, v, p).
//      /   \         Everything here is a function of its four corners, in double without fused operations: the same on
//     u-----v        every processor.
//      \   /
//        p
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "engine/tin/mesh/star.h"
#include "engine/tin/mesh/triangulation.h"

namespace terrace::tin {

struct Quadrilateral {
  RingVertex u, v, w;
  float height = 0;  // of p, metres
};

// The squared quality of each way, times a common factor. Larger is better. The quality is the geometric mean of area
// over diameter of the two triangles, the root of the paper's SHAPE_QUALITY (section 4.3). The diameter in Scape, the
// paper's program, is the longer side of the bounding box. This one adds a quarter of the shorter side, which is within
// 12 % of the diagonal.
struct ShapeQuality {
  double uv = 0;
  double pw = 0;
};

// Four times the diameters of (u, w, p), (w, v, p), (u, v, p) and (v, u, w), computed together: coordinates are below
// 2^15, so that offsets and extents fit 16 bits. Computed separately, some of the comparisons would be branches that
// are mispredicted.
using ShortVector = std::int16_t __attribute__((vector_size(16)));
using IntVector = std::int32_t __attribute__((vector_size(16)));
inline IntVector QuadrupleDiameters(const RingVertex& u_vertex, const RingVertex& v_vertex,
                                    const RingVertex& w_vertex) {
  const auto pair = [](const RingVertex& vertex) {
    return static_cast<std::int32_t>(static_cast<std::uint32_t>(vertex.dy) << 16 |
                                     (static_cast<std::uint32_t>(vertex.dx) & 0xFFFF));
  };
  const std::int32_t u = pair(u_vertex), v = pair(v_vertex), w = pair(w_vertex);
  const auto a = reinterpret_cast<ShortVector>(IntVector{u, w, u, v}),
             b = reinterpret_cast<ShortVector>(IntVector{w, v, v, u}),
             c = reinterpret_cast<ShortVector>(IntVector{0, 0, 0, w});
  const auto larger = [](ShortVector x, ShortVector y) { return x > y ? x : y; };
  const auto smaller = [](ShortVector x, ShortVector y) { return x < y ? x : y; };
  const auto extents = reinterpret_cast<IntVector>(larger(larger(a, b), c) - smaller(smaller(a, b), c));
  const IntVector of_x = extents & 0xFFFF, of_y = extents >> 16;
  const auto longer =
      reinterpret_cast<IntVector>(larger(reinterpret_cast<ShortVector>(of_x), reinterpret_cast<ShortVector>(of_y)));
  return of_x + of_y + longer + (longer << 1);
}

inline ShapeQuality ShapeQualityOf(const Quadrilateral& q) {
  const double uvp = Cross(q.u, q.v), uwp = Cross(q.u, q.w), wvp = Cross(q.w, q.v);
  const IntVector diameters = QuadrupleDiameters(q.u, q.v, q.w);
  // Multiplies by the other diameter instead of dividing by the own one. Below 2^36.
  const auto of_pw = static_cast<double>(std::int64_t{diameters[0]} * diameters[1]);
  const auto of_uv = static_cast<double>(std::int64_t{diameters[2]} * diameters[3]);
  return {uvp * (uwp + wvp - uvp) * of_pw, uwp * wvp * of_uv};
}

// The upward normal (x, y, 1) of the plane through three vertices, in metres per sample.
struct Normal {
  constexpr Normal(const RingVertex& a, const RingVertex& b, const RingVertex& c) {
    const double bx = b.dx - a.dx, by = b.dy - a.dy, cx = c.dx - a.dx, cy = c.dy - a.dy;
    const double bz = static_cast<double>(b.height) - static_cast<double>(a.height),
                 cz = static_cast<double>(c.height) - static_cast<double>(a.height), area = bx * cy - cx * by;
    x = (by * cz - cy * bz) / area;
    y = (cx * bz - bx * cz) / area;
  }
  double x = 0, y = 0;
};

// The cosine of the angle between two planes. Slopes of floats stay below 2^144: no product overflows.
inline double CosineBetween(const Normal& a, const Normal& b) {
  return (a.x * b.x + a.y * b.y + 1) / std::sqrt((a.x * a.x + a.y * a.y + 1) * (b.x * b.x + b.y * b.y + 1));
}

// The angle between the two triangles of each way, across the diagonal alone: twice the squared sine of half the angle
// between their normals (Dyn, Levin and Rippa, "Data Dependent Triangulations for Piecewise Linear Interpolation",
// 1990).
struct NormalAngles {
  double uv = 0;
  double pw = 0;
};
inline NormalAngles NormalAnglesOf(const Quadrilateral& q) {
  const RingVertex p{0, 0, 0, q.height};
  // Rounding may make a cosine larger than 1.
  const auto angle = [](const Normal& a, const Normal& b) { return std::max(0.0, 1 - CosineBetween(a, b)); };
  return {angle(Normal(q.u, q.v, p), Normal(q.v, q.u, q.w)), angle(Normal(q.u, q.w, p), Normal(q.w, q.v, p))};
}

}  // namespace terrace::tin
