#include "tiler/mesh/refine_options.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/dem/tile_edits.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/sines.h"
#include "proto/mesh/quantized_mesh.h"
#include "tiler/mesh/edit_limits.h"

namespace terrace::tiler {
namespace {

// A bound in metres on the sagitta of the right triangles of a grid of `divisions` x `divisions` over a tile of this
// level. Tiles count as wide as at the equator, so that all tiles of a level, and therefore neighbours, use the same
// grids.
double GridSagitta(int level, int divisions) {
  const double side = std::ldexp(geo::kSemiMajorAxis * geo::ToRadians(180), -level) / divisions;
  return side * side / (4 * geo::kSmallestRadius);
}

tin::Curvature MakeCurvature(const proto::TileSamples& samples) {
  const double step = samples.lattice.StepDegrees();
  std::vector<double> latitudes;
  for (int j = 0; j <= samples.cells(); ++j) latitudes.push_back(samples.Latitude(j));
  const double north = geo::ToRadians(step) * geo::kLargestRadius;
  return {SquaredEastSteps(latitudes, step), north * north, geo::kSmallestRadius};
}

// Triangles with a sagitta above half of the error leave too little of the error for relief. Therefore the next finer
// grid is due when the error falls below twice their sagitta. Insertion then has triangles that are small enough to
// select samples by relief.
std::vector<tin::SeedGrid> MakeSeedGrids(const proto::TileSamples& samples) {
  std::vector<tin::SeedGrid> grids;
  for (int divisions = 2; divisions <= samples.cells() / 2; divisions *= 2) {
    grids.push_back({2 * GridSagitta(samples.key.level, divisions / 2), samples.cells() / divisions});
  }
  return grids;
}

// Half the second difference of the ground along an edge, per sample squared.
double BorderSagitta(const proto::TileSamples& samples, tin::Side side) {
  const double step = geo::ToRadians(samples.lattice.StepDegrees());
  if (side == tin::Side::kEast || side == tin::Side::kWest) return step * step * geo::kLargestRadius / 2;
  const double latitude = samples.Latitude(side == tin::Side::kSouth ? 0 : samples.cells());
  const double cosine = geo::SurfaceNormal(0, latitude).x;
  return step * step * geo::PrimeVerticalRadius(latitude) * cosine * cosine / 2;
}

// The error of an edge from the rounding of positions: half a unit times its steepest slope.
double PositionRounding(const proto::TileSamples& samples, tin::Side side) {
  const int cells = samples.cells();
  const bool along_x = side == tin::Side::kSouth || side == tin::Side::kNorth;
  const int fixed = side == tin::Side::kSouth || side == tin::Side::kWest ? 0 : cells;
  double steepest = 0;
  for (int k = 0; k < cells; ++k) {
    const double a = along_x ? samples.At(k, fixed) : samples.At(fixed, k);
    const double b = along_x ? samples.At(k + 1, fixed) : samples.At(fixed, k + 1);
    steepest = std::max(steepest, std::abs(b - a));
  }
  return steepest * cells / (2.0 * proto::kQuantizedMax);
}

}  // namespace

// Near the equator neighbouring rows differ by less than the rounding of their sines. Makes widths increase up to the
// widest row and decrease after it, as Curvature requires.
std::vector<double> SquaredEastSteps(std::span<const double> latitudes, double step) {
  std::vector<double> east_m2;
  for (const geo::SinCos& latitude : geo::RoundedSinCosOf(latitudes)) {
    const double east = geo::MetresPerDegreeEast(latitude) * step;
    east_m2.push_back(east * east);
  }
  const auto wider = [](double a, double b) { return std::max(a, b); };
  const auto begin = east_m2.begin(), widest = std::max_element(begin, east_m2.end());
  std::inclusive_scan(begin, widest, begin, wider);
  const auto back = east_m2.rbegin(), widest_back = std::make_reverse_iterator(widest);
  std::inclusive_scan(back, widest_back, back, wider);
  return east_m2;
}

// Rounding changes the heights of an edge by up to half of the edge's height step. The height step is at most the
// larger of an eighth of the error and what the edge needs at any error. BorderOptions::weight accounts for the first,
// step_m for the second.
tin::GreedyOptions BaseRefineOptions(const proto::TileSamples& samples, const proto::EdgeSteps& finest) {
  tin::GreedyOptions options;
  options.curvature = MakeCurvature(samples);
  options.seeds = MakeSeedGrids(samples);
  options.record = true;
  for (const tin::Side side : {tin::Side::kSouth, tin::Side::kEast, tin::Side::kNorth, tin::Side::kWest}) {
    tin::BorderOptions& border = options.borders[static_cast<std::size_t>(side)];
    border.weight = 16.0 / 15;
    border.padding_m = PositionRounding(samples, side);
    border.rounding = samples.cells() / (2.0 * proto::kQuantizedMax);
    border.step_m = finest.Coarsest(side) / 2;
    border.sagitta_m = BorderSagitta(samples, side);
  }
  return options;
}

proto::EdgeSteps EdgeStepsOf(const dem::ElevationModel& model, const geo::TileKey& key,
                             const proto::EdgeErrors& errors) {
  const std::int64_t rows = geo::TileRows(key.level);
  std::array<std::array<double, 3>, 3> needed{};
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const geo::TileKey neighbour = geo::Neighbour(key, dx, dy);
      if (neighbour.y < 0 || neighbour.y >= rows) continue;
      const dem::HeightRange range = model.RangeBound(neighbour);
      needed[static_cast<std::size_t>(dy + 1)][static_cast<std::size_t>(dx + 1)] =
          proto::NeededStep(range.min, range.max);
    }
  }
  const dem::DemInfo& info = model.info();
  const double pole_step =
      proto::NeededStep(std::min(info.heights.min, info.floor), std::max(info.heights.max, info.floor));
  return proto::MakeEdgeSteps(errors, needed, pole_step, key.y == 0, key.y == rows - 1);
}

tin::GreedyOptions RefineOptionsOf(const dem::ElevationModel& model, const proto::TileSamples& samples,
                                   tin::Criterion criterion) {
  const proto::EdgeErrors smallest(proto::kHeightResolution);
  tin::GreedyOptions options = BaseRefineOptions(samples, EdgeStepsOf(model, samples.key, smallest));
  dem::MeshDemands demands = dem::TileEdits(model).DemandsOf(samples.key);
  // The outline of a hole is a chain of forced nodes with steps of one cell or its diagonal. Edges of a Delaunay
  // triangulation do not cross such steps, except where both diagonals of a cell are Delaunay. Edges that the
  // data-dependent criterion prefers may.
  options.criterion = demands.no_triangles.empty() ? criterion : tin::Criterion::kDelaunay;
  options.limits = LimitsOf(std::move(demands));
  return options;
}

}  // namespace terrace::tiler
