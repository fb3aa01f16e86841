// The two ways to cut a convex quadrilateral into triangles, compared by their shape and by their bend.
//
//        w           The quadrilateral (p, u, w, v), counter-clockwise, seen from the point p that is being inserted.
//        It is
//       / \          cut by u-v into (u, v, p) and (v, u, w), or by p-w into (u, w, p) and (w, v, p).
//      /   \         Everything here is a function of its four corners, in double without fused operations: the same on
//     u-----v        every processor.
//      \   /
//        p
#pragma once

#include <algorithm>
#include <cmath>

#include "engine/tin/star.h"
#include "engine/tin/triangulation.h"

namespace terrace::tin {

struct Quadrilateral {
  RingVertex u, v, w;
  float height = 0;  // of p, metres
};

// Of each cut: the product of the areas of its triangles over the product of their diameters, which the paper (section
// 4) uses as SHAPE_QUALITY, times one number for both. Larger is better. The diameter is that of the bounding box: its
// longer side.
struct ShapeQuality {
  double uv = 0;
  double pw = 0;
};

// Without branches, which nothing could foretell.
constexpr int Extent(int a, int b, int c) { return std::max(std::max(a, b), c) - std::min(std::min(a, b), c); }

constexpr double BoxDiameter(const RingVertex& a, const RingVertex& b, const RingVertex& c) {
  return std::max(Extent(a.dx, b.dx, c.dx), Extent(a.dy, b.dy, c.dy));
}

constexpr ShapeQuality ShapeQualityOf(const Quadrilateral& q) {
  const RingVertex p;
  const auto uvp = static_cast<double>(Cross(q.u, q.v)), uwp = static_cast<double>(Cross(q.u, q.w)),
             wvp = static_cast<double>(Cross(q.w, q.v));
  const double vuw = uwp + wvp - uvp;  // exact
  // Instead of a division by the one, a multiplication by the other.
  return {uvp * vuw * (BoxDiameter(q.u, q.w, p) * BoxDiameter(q.w, q.v, p)),
          uwp * wvp * (BoxDiameter(q.u, q.v, p) * BoxDiameter(q.v, q.u, q.w))};
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

// Whether the two triangles of the cut p-w are closer to one plane than those of u-v: the angle between normals of Dyn,
// Levin and Rippa, "Data Dependent Triangulations for Piecewise Linear Interpolation" (1990), across the diagonal
// alone.
inline bool BendsLessAlongPw(const Quadrilateral& q) {
  const RingVertex p{0, 0, 0, q.height};
  return CosineBetween(Normal(q.u, q.w, p), Normal(q.w, q.v, p)) >
         CosineBetween(Normal(q.u, q.v, p), Normal(q.v, q.u, q.w));
}

}  // namespace terrace::tin
