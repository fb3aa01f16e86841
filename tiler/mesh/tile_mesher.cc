#include "tiler/mesh/tile_mesher.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/dem/tile_edits.h"
#include "engine/geo/tile_key.h"
#include "engine/tin/decimate/drop_pass.h"
#include "proto/error/surface_error.h"
#include "proto/error/tile_error.h"
#include "proto/mesh/edge_steps.h"
#include "proto/mesh/quantize_tile.h"
#include "tiler/mesh/edit_limits.h"
#include "tiler/mesh/inner_vertices.h"
#include "tiler/mesh/refine_options.h"
#include "tiler/mesh/restore_error_bound.h"

namespace terrace::tiler {
namespace {

using Clock = std::chrono::steady_clock;

// Quantizes, and inserts the samples that quantization pushed over the bound.
Result<MeshedTile> Finish(tin::TinMesh mesh, const proto::TileSamples& samples, const proto::EdgeSteps& steps,
                          const dem::MeshDemands& demands, double error_m, const std::stop_token& stop) {
  proto::TileErrorMeter meter(samples, error_m, AllowedErrors(LimitsOf(demands), error_m));
  MeshedTile meshed;
  const auto measure = [&](const tin::TinMesh& candidate) {
    meshed.tile = proto::QuantizeTile(samples, candidate, steps);
    return meter.Measure(meshed.tile);
  };
  const Result<proto::TileError> measured = RestoreErrorBound(mesh, measure, proto::kMaxTileVertices, stop);
  if (!measured) return tl::unexpected(measured.error());
  meshed.max_error_m = measured->max_m;
  meshed.positions = meter.positions();
  meshed.surface_error_m = proto::MeasureSurfaceError(samples, meshed.tile, meshed.positions, measured->max_m);
  meshed.in_hole = TrianglesInHoles(demands, samples.cells() + 1, mesh);
  meshed.mesh = std::move(mesh);
  return meshed;
}

// Makes a mesh within the format's limit of vertices. Inside the tile its error is `scale` times the requested one;
// `scale`, a power of two, doubles until the mesh keeps the limit. Edges and seeds stay those of the requested error:
// their errors and thresholds are multiplied by `scale` too, which is exact. `error_m`: the requested error; becomes
// the error that was reached inside.
Result<tin::TinMesh> RefineWithinFormat(const tin::HeightField& field, const tin::GreedyOptions& unscaled, double scale,
                                        double& error_m, const std::stop_token& stop) {
  for (;; scale *= 2) {
    tin::GreedyOptions options = unscaled;
    options.record = false;
    for (tin::BorderOptions& border : options.borders) border.scale = scale;
    options.limits_scale = scale;
    for (tin::SeedGrid& grid : options.seeds) grid.below_error *= scale;
    tin::GreedyTriangulation greedy(field, std::move(options));
    tin::GreedyGoal goal;
    goal.max_error = error_m * scale;
    goal.max_points = proto::kMaxTileVertices + 1;
    if (!greedy.Run(goal, stop)) return Cancelled();
    if (greedy.vertex_count() > proto::kMaxTileVertices) continue;
    error_m = goal.max_error;
    return greedy.Mesh();
  }
}

// The drop pass uses its whole bound, and samples that quantization pushes over it would be inserted again. Therefore a
// 32nd of the bound is reserved for quantization.
Result<tin::TinMesh> Compact(const tin::HeightField& field, const tin::TinMesh& mesh, const tin::GreedyOptions& greedy,
                             double error_m, const std::stop_token& stop) {
  std::vector<std::uint16_t> quantized;
  for (int i = 0; i < field.width(); ++i) quantized.push_back(proto::QuantizedPosition(i, field.width() - 1));
  tin::DropOptions options;
  options.max_error = error_m * 31 / 32;
  options.curvature = greedy.curvature;
  if (!greedy.limits.empty()) options.limits = &greedy.limits;
  options.quantized_columns = quantized;
  options.quantized_rows = quantized;
  std::optional<tin::TinMesh> dropped = tin::DropVertices(field, mesh, options, stop);
  if (!dropped) return Cancelled();
  return *std::move(dropped);
}

}  // namespace

tl::unexpected<Error> Cancelled() { return MakeError(ErrorCode::kCancelled, "the build of this tile was stopped"); }

tin::HeightField FieldOf(const proto::TileSamples& samples) {
  const int side = samples.cells() + 1;
  std::vector<float> heights;
  heights.reserve(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
  for (int j = 0; j < side; ++j) {
    const float* const row = samples.heights.data() + (j + 1) * (side + 2) + 1;  // within the halo
    heights.insert(heights.end(), row, row + side);
  }
  auto field = tin::HeightField::Make(side, side, std::move(heights));
  TERRACE_CHECK(field.has_value());  // every lattice height is finite
  return *std::move(field);
}

Result<ReplayedMesh> ReplayMesh(const dem::ElevationModel& model, const proto::TileSamples& samples,
                                const std::optional<tin::Refinement>& refinement, const MeshOptions& mesh_options,
                                double wanted_error_m, const std::stop_token& stop) {
  double error_m = wanted_error_m;
  Result<tin::TinMesh> mesh =
      refinement ? refinement->MeshAt(error_m)
                 : RefineWithinFormat(FieldOf(samples), RefineOptionsOf(model, samples, mesh_options.criterion), 2,
                                      error_m, stop);
  if (mesh && mesh_options.compact) {
    mesh = Compact(FieldOf(samples), *mesh, RefineOptionsOf(model, samples, mesh_options.criterion), error_m, stop);
  }
  if (!mesh) return tl::unexpected(std::move(mesh).error());
  return ReplayedMesh{WithInnerVertices(samples, *std::move(mesh)), error_m};
}

Result<MeshedTile> MeshTile(const dem::ElevationModel& model, const proto::TileSamples& samples,
                            const std::optional<tin::Refinement>& refinement, const MeshOptions& mesh_options,
                            double wanted_error_m, const std::stop_token& stop) {
  const dem::MeshDemands demands = dem::TileEdits(model).DemandsOf(samples.key);
  const proto::EdgeSteps steps =
      EdgeStepsOf(model, samples.key, EdgeErrorsOf(model, samples.key, LimitsOf(demands), wanted_error_m));
  const Clock::time_point start = Clock::now();
  Result<ReplayedMesh> replayed = ReplayMesh(model, samples, refinement, mesh_options, wanted_error_m, stop);
  if (!replayed) return tl::unexpected(std::move(replayed).error());
  double error_m = replayed->error_m;
  const auto replay_time = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start);
  Result<MeshedTile> meshed = Finish(std::move(replayed->mesh), samples, steps, demands, error_m, stop);
  if (meshed) meshed->replay_time = replay_time;
  if (!meshed || proto::AllCounterClockwise(meshed->tile)) return meshed;

  error_m = wanted_error_m;
  Result<tin::TinMesh> mesh = RefineWithinFormat(
      FieldOf(samples), RefineOptionsOf(model, samples, tin::Criterion::kDelaunay), 1, error_m, stop);
  if (!mesh) return tl::unexpected(std::move(mesh).error());
  meshed = Finish(*std::move(mesh), samples, steps, demands, error_m, stop);
  if (meshed && !proto::AllCounterClockwise(meshed->tile)) {
    return MakeError(ErrorCode::kInternal, "{}: a triangle turned over", geo::ToString(samples.key));
  }
  return meshed;
}

}  // namespace terrace::tiler
