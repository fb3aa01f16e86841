#include "server/tiles/refine_plan.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/geo/ellipsoid.h"
#include "proto/quantized_mesh.h"

namespace terrace::server {
namespace {

constexpr double kSmallestRadius =
    geo::kSemiMinorAxis * geo::kSemiMinorAxis / geo::kSemiMajorAxis;  // meridian, at the equator
constexpr double kLargestRadius = geo::kSemiMajorAxis * geo::kSemiMajorAxis / geo::kSemiMinorAxis;  // at the poles

// Metres that the right triangles of a grid of `divisions` x `divisions` over a tile of this level can sag. The same
// for every tile of the level, so that neighbours start from the same grid: tiles are taken as wide as at the equator.
double GridSagitta(int level, int divisions) {
  const double side = std::ldexp(geo::kSemiMajorAxis * geo::ToRadians(180), -level) / divisions;
  return side * side / (4 * kSmallestRadius);
}

tin::Curvature MakeCurvature(const proto::LatticeView& lattice) {
  const double step = lattice.lattice.StepDegrees();
  tin::Curvature curvature;
  for (int j = 0; j <= lattice.cells(); ++j) {
    const double east = geo::MetresPerDegreeEast(lattice.Latitude(j)) * step;
    curvature.east_m2.push_back(east * east);
  }
  const double north = geo::ToRadians(step) * kLargestRadius;
  curvature.north_m2 = north * north;
  curvature.radius_m = kSmallestRadius;
  return curvature;
}

// The coarsest grid whose triangles sag at most half of the error leaves the rest of it to the relief, and gives the
// insertion triangles small enough to place samples by relief alone.
tin::SeedGrid MakeSeedGrid(const proto::LatticeView& lattice, double error_m) {
  int divisions = 1;
  while (divisions < lattice.cells() / 2 && GridSagitta(lattice.key.level, divisions) > error_m / 2) divisions *= 2;
  return {std::numeric_limits<double>::infinity(), lattice.cells() / divisions};
}

// Half the second difference of the ground along an edge, per sample squared.
double BorderSagitta(const proto::LatticeView& lattice, tin::Side side) {
  const double step = geo::ToRadians(lattice.lattice.StepDegrees());
  if (side == tin::Side::kEast || side == tin::Side::kWest) return step * step * kLargestRadius / 2;
  const double latitude = lattice.Latitude(side == tin::Side::kSouth ? 0 : lattice.cells());
  const double cosine = geo::SurfaceNormal(0, latitude).x;
  return step * step * geo::PrimeVerticalRadius(latitude) * cosine * cosine / 2;
}

// What an edge loses to the wire: half a step of its height grid, and half a unit of position times its steepest slope.
double BorderRounding(const proto::LatticeView& lattice, const proto::EdgeSteps& steps, tin::Side side) {
  const int cells = lattice.cells();
  const bool along_x = side == tin::Side::kSouth || side == tin::Side::kNorth;
  const int fixed = side == tin::Side::kSouth || side == tin::Side::kWest ? 0 : cells;
  double steepest = 0;
  for (int k = 0; k < cells; ++k) {
    const double a = along_x ? lattice.At(k, fixed) : lattice.At(fixed, k);
    const double b = along_x ? lattice.At(k + 1, fixed) : lattice.At(fixed, k + 1);
    steepest = std::max(steepest, std::abs(b - a));
  }
  return steps.Coarsest(side) / 2 + steepest * cells / (2.0 * proto::kQuantizedMax);
}

}  // namespace

RefinePlan MakeRefinePlan(const proto::LatticeView& lattice, const proto::EdgeSteps& steps, double error_m) {
  RefinePlan plan;
  plan.curved = GridSagitta(lattice.key.level, 1) > error_m / 100;
  if (plan.curved) {
    plan.options.curvature = MakeCurvature(lattice);
    plan.options.seeds.push_back(MakeSeedGrid(lattice, error_m));
  }
  for (const tin::Side side : {tin::Side::kSouth, tin::Side::kEast, tin::Side::kNorth, tin::Side::kWest}) {
    tin::BorderOptions& border = plan.options.borders[static_cast<std::size_t>(side)];
    // Cliffs can eat the whole bound; a quarter is kept so that the edge does not take every sample for nothing.
    border.weight = error_m / std::max(error_m - BorderRounding(lattice, steps, side), error_m / 4);
    border.sagitta_m = plan.curved ? BorderSagitta(lattice, side) : 0;
  }
  return plan;
}

}  // namespace terrace::server
