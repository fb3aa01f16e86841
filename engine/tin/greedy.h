// Greedy insertion of height samples into a triangulation: Delaunay, or chosen by how well it fits the samples.
//
// Garland and Heckbert, "Fast Triangular Approximation of Terrains and Height Fields" (1997), section 3.3, algorithm
// III: every triangle keeps its worst sample as a candidate, a queue yields the worst of all, and only the triangles
// that an insertion changed are scanned again. The result is a function of the field and the options alone: predicates
// are exact, and equal errors are ordered by their samples, row by row.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <stop_token>
#include <vector>

#include "engine/tin/criterion.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/refinement.h"

namespace terrace::tin {

// The four borders of a field.
enum class Side : std::uint8_t {
  kSouth = 0 /* y = 0 */,
  kEast = 1 /* x = width-1 */,
  kNorth = 2 /* y = height-1 */,
  kWest = 3 /* x = 0 */
};

// How samples on one border are judged. A border sample k between the border's vertices a < b misses by
//   m = |(h_a (b - k) + h_b (k - a)) / (b - a) - h_k| + sagitta_m (k - a) (b - k)
// evaluated in double in exactly this form, a < b counted along increasing x or y, and its error is
//   scale min(max((m + padding_m) weight, m + padding_m + step_m), kMaxBorderWeight m):
// what a vertex on the border loses to a rounding that grows with the error (weight), to rounding by fixed amounts
// (padding_m, step_m), with a limit so that a border full of cliffs does not take every sample for nothing. This is a
// function of that border's own samples. Two fields that share a border with equal heights and options therefore insert
// the same border vertices, whatever their insides look like.
struct BorderOptions {
  double weight = 1;
  double padding_m = 0;
  double step_m = 0;
  double sagitta_m = 0;  // half the second difference of the ground that the border's chord cuts off
  double scale = 1;      // the error counts so many times: a border threshold of E / scale in a run to the error E
};
inline constexpr double kMaxBorderWeight = 4;

// The ground under the field is curved: a flat triangle with corners (dx, dy) samples apart cuts below it by up to its
// sagitta. Squared lengths are q = dx^2 east_m2[row] + dy^2 north_m2, with the largest east_m2 of the triangle's rows;
// the sagitta bound is (largest distance from a corner within the triangle)^2 / (2 radius): the squared circumradius
// for acute triangles, else a quarter of the longest side squared. It is added to the error of every sample of the
// triangle.
struct Curvature {
  // Per row: squared metres per column step; empty: flat ground. Rising up to some row, falling after it.
  std::vector<double> east_m2;
  double north_m2 = 0;  // squared metres per row step
  double radius_m = 0;
};

// A regular grid of samples, every `step` columns and rows, that must be vertices of every mesh whose error is below
// `below_error`. `step` divides width - 1 and height - 1.
struct SeedGrid {
  double below_error = 0;
  int step = 1;
};

// What data-dependent triangulation holds against a pair of triangles that could be cut along their other diagonal
// (section 3.4.1).
enum class FitMeasure : std::uint8_t {
  kSumMax,      // the sum of their largest errors
  kSumSquares,  // the sum of all squared distances
  kMaxMax,      // the larger of their largest errors
  kNormals,     // the angle between their normals, metres over samples: looks at no sample but the corners
};

struct DataDependentOptions {
  FitMeasure measure = FitMeasure::kSumMax;
  // From 0 to 1 (section 3.4.2): how far the shapes of two cuts may be apart for their fit to count (data_dependent.h).
  // 0 looks at the fit alone, 1 at the shape wherever it differs. Between them errors are held against the quality of
  // the shape, which the paper does not.
  double qthresh = 0.5;
};

struct GreedyOptions {
  Criterion criterion = Criterion::kDelaunay;
  DataDependentOptions data_dependent;
  std::array<BorderOptions, 4> borders;  // by Side
  Curvature curvature;
  std::vector<SeedGrid> seeds;  // in order of decreasing below_error
  bool record = false;          // keep the order of insertions for MakeRefinement
};

// A run stops as soon as one of these holds.
struct GreedyGoal {
  double max_error = 0;                                              // no sample is further off, metres
  std::size_t max_points = std::numeric_limits<std::size_t>::max();  // vertices, the four corners included
  double rms_error = 0;  // root mean square over the valid samples, metres; 0: not a goal
};

class GreedyTriangulation {
 public:
  // Starts with the two triangles of the field's corners. `field` must outlive this object.
  explicit GreedyTriangulation(const HeightField& field, GreedyOptions options = {});

  // Goes on where a refinement of the same field with the same options has ended. Precondition: its run met an error
  // or there are no seeds; one that ended inside a seed grid goes on with another order of insertions.
  GreedyTriangulation(const HeightField& field, GreedyOptions options, const Refinement& refinement);
  ~GreedyTriangulation();
  GreedyTriangulation(GreedyTriangulation&&) noexcept;
  GreedyTriangulation& operator=(GreedyTriangulation&&) noexcept;

  // Inserts samples, worst first, until a goal is met. A later call with a tighter goal goes on from there and ends in
  // the mesh that one call with that goal would have made. False if stopped; the mesh is then valid but unfinished.
  bool Run(const GreedyGoal& goal, std::stop_token stop = {});

  // The largest error that the next insertion would mend; 0 when every sample is met.
  double CurrentError() const;
  std::size_t vertex_count() const;

  // Triangles in the order of their slots.
  TinMesh Mesh() const;

  // Everything inserted so far. Precondition: options.record.
  Refinement MakeRefinement() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::tin
