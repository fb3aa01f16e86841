// Greedy insertion of height samples into a triangulation, which is Delaunay or data-dependent.
//
// Garland and Heckbert, "Fast Triangular Approximation of Terrains and Height Fields" (1997), section 3.3, algorithm
// III: every triangle keeps its worst sample as a candidate, a queue yields the worst candidate of all, and only the
// triangles that an insertion changed are scanned again. The result depends on the field and the options alone:
// predicates are exact, and samples whose errors round up to the same float are ordered row by row.
//
// Not thread-safe; different objects are independent.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <stop_token>
#include <vector>

#include "engine/tin/criterion.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "engine/tin/refinement.h"
#include "engine/tin/sample_limits.h"

namespace terrace::tin {

// The four borders of a field.
enum class Side : std::uint8_t {
  kSouth = 0 /* y = 0 */,
  kEast = 1 /* x = width-1 */,
  kNorth = 2 /* y = height-1 */,
  kWest = 3 /* x = 0 */
};

// The error of samples on one border. Let a < b be two neighbouring vertices on the border, counted along increasing x
// or y, and k a sample between them. Its distance from the chord is
//   m = |(h_a (b - k) + h_b (k - a)) / (b - a) - h_k| + sagitta_m (k - a) (b - k)
// evaluated in double in exactly this form. Its error is scale * e with
//   e = min(max((m + padding_m) * weight, m + padding_m + step_m), kMaxBorderWeight * m).
// In a field with limits (sample_limits.h), let W be SampleLimits::WeightedError. A sample with a limit and m > 0 has
//   scale * W(max((m + p) * weight, m + p + step_m))  with p = rounding * |h_b - h_a| / (b - a).
// All other samples have scale * W(e). W puts forced samples first. `weight` makes room for rounding that
// grows with the error, `padding_m` for the rounding of positions where the border is steepest, `step_m` for half the
// unit to which heights are rounded at the smallest error, and p for the rounding of positions along the sample's own
// chord. The limit kMaxBorderWeight keeps a border with many cliffs from taking every sample. The error depends on the
// samples of this border alone: two fields that share a border with equal heights and options insert the same border
// vertices, whatever their interiors are.
struct BorderOptions {
  double weight = 1;
  double padding_m = 0;
  double step_m = 0;
  double rounding = 0;   // how far, in samples, rounding may move a vertex along the border
  double sagitta_m = 0;  // half the second difference of the curved ground along the border
  double scale = 1;      // factor on the error: in a run to the error E the border is refined to E / scale
};
inline constexpr double kMaxBorderWeight = 4;

// The ground under the field is curved: a flat triangle cuts below it by at most the triangle's sagitta. The squared
// distance between positions (dx, dy) samples apart is q = dx^2 east_m2[row] + dy^2 north_m2, with the largest east_m2
// of the triangle's rows. The bound on the sagitta is d / (2 radius_m). d is the squared circumradius of an acute
// triangle, and a quarter of the squared longest side of any other. The bound is added to the error of every sample of
// the triangle.
struct Curvature {
  // Per row: squared metres per column step; empty: flat ground. Increases up to some row and decreases after it.
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

// The misfit that data-dependent triangulation compares between the two ways to divide a quadrilateral into triangles
// (section 3.4.1).
enum class FitMeasure : std::uint8_t {
  kSumMax,      // the sum of their largest errors
  kSumSquares,  // the sum of all squared distances
  kMaxMax,      // the larger of their largest errors
  kNormals,     // the angle between their normals, in metres per sample; uses the corners alone
};

struct DataDependentOptions {
  FitMeasure measure = FitMeasure::kSumMax;
  // From 0 to 1 (section 3.4.2). The lower it is, the more the shapes of the two ways may differ before the shape
  // decides instead of the misfit (data_dependent.h). At 0 the misfit alone decides; at 1 the shape decides wherever it
  // differs. In between, misfits are weighted by the quality of the shape, which the paper does not do.
  double qthresh = 0.5;
};

struct GreedyOptions {
  Criterion criterion = Criterion::kDelaunay;
  DataDependentOptions data_dependent;
  std::array<BorderOptions, 4> borders;  // by Side
  Curvature curvature;
  std::vector<SeedGrid> seeds;  // in order of decreasing below_error
  SampleLimits limits;          // may be empty
  double limits_scale = 1;      // `scale` of SampleLimits::WeightedError, inside; 1 on borders
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

  // Continues where a refinement of the same field with the same options ended. Precondition: its run reached its error
  // goal, or there are no seeds. A run that ended inside a seed grid would continue with another order of insertions.
  GreedyTriangulation(const HeightField& field, GreedyOptions options, const Refinement& refinement);
  ~GreedyTriangulation();
  GreedyTriangulation(GreedyTriangulation&&) noexcept;
  GreedyTriangulation& operator=(GreedyTriangulation&&) noexcept;

  // Inserts samples, worst first, until a goal is met. A later call with a tighter goal continues from there; the mesh
  // is the one that a single call with that goal would have made. Returns false if stopped; the mesh is then valid but
  // unfinished.
  bool Run(const GreedyGoal& goal, std::stop_token stop = {});

  // The largest error of a candidate; 0 if there is none.
  double CurrentError() const;
  std::size_t vertex_count() const;

  // Triangles in the order in which they are stored: an insertion reuses the places of those that it removes.
  TinMesh Mesh() const;

  // Everything inserted so far; null if that is more than a refinement may have. Precondition: options.record.
  std::optional<Refinement> MakeRefinement() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::tin
