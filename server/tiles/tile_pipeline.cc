#include "server/tiles/tile_pipeline.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <array>
#include <utility>

#include "engine/core/check.h"
#include "engine/geo/error_ladder.h"
#include "engine/tin/greedy.h"
#include "engine/tin/insert_samples.h"
#include "proto/compress.h"
#include "proto/edge_steps.h"
#include "proto/quantized_mesh.h"
#include "proto/tile_error.h"
#include "proto/tile_mesh.h"
#include "proto/tile_normals.h"
#include "server/tiles/refine_plan.h"

namespace terrace::server {
namespace {

using Clock = std::chrono::steady_clock;

std::chrono::microseconds Since(Clock::time_point start) {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start);
}

tl::unexpected<Error> Cancelled() { return MakeError(ErrorCode::kCancelled, "nobody waits for this tile any more"); }

proto::EdgeSteps EdgeStepsOf(const dem::DemSource& source, const geo::TileKey& key, double error_m) {
  const std::int64_t rows = geo::TileRows(key.level);
  std::array<std::array<double, 3>, 3> needed{};
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const geo::TileKey neighbour = geo::Neighbour(key, dx, dy);
      if (neighbour.y < 0 || neighbour.y >= rows) continue;
      const dem::HeightRange range = source.RangeBound(neighbour);
      needed[static_cast<std::size_t>(dy + 1)][static_cast<std::size_t>(dx + 1)] =
          proto::NeededStep(range.min, range.max);
    }
  }
  const dem::DemInfo& info = source.info();
  const double pole_step =
      proto::NeededStep(std::min(info.heights.min, info.floor), std::max(info.heights.max, info.floor));
  return proto::MakeEdgeSteps(error_m, needed, pole_step, key.y == 0, key.y == rows - 1);
}

tin::HeightField FieldOf(const proto::LatticeView& lattice) {
  const int side = lattice.cells() + 1;
  std::vector<float> heights;
  heights.reserve(static_cast<std::size_t>(side) * static_cast<std::size_t>(side));
  for (int j = 0; j < side; ++j) {
    for (int i = 0; i < side; ++i) heights.push_back(lattice.At(i, j));
  }
  auto field = tin::HeightField::Make(side, side, std::move(heights));
  TERRACE_CHECK(field.has_value());  // every lattice height is finite
  return *std::move(field);
}

struct MeasuredTile {
  tin::TinMesh mesh;
  proto::QuantizedTile tile;
  double max_error_m = 0;
};

// Inserts what the wire's rounding pushed over the bound, until nothing that an insertion can mend is left.
Result<MeasuredTile> Finish(tin::TinMesh mesh, const proto::LatticeView& lattice, const proto::EdgeSteps& steps,
                            double error_m, bool curved, const std::stop_token& stop) {
  constexpr int kMaxRounds = 16;  // two are usual; a cliff may keep a sample out of reach for ever
  for (int round = 1;; ++round) {
    if (stop.stop_requested()) return Cancelled();
    MeasuredTile measured;
    measured.tile = proto::QuantizeTile(lattice, mesh, steps);
    const proto::TileError error = proto::MeasureTileError(lattice, measured.tile, error_m, curved);
    measured.max_error_m = error.max_m;
    if (error.misses.empty() || round == kMaxRounds ||
        mesh.vertices.size() + error.misses.size() > proto::kMaxTileVertices) {
      measured.mesh = std::move(mesh);
      return measured;
    }
    mesh = tin::InsertSamples(mesh, error.misses);
  }
}

// A mesh for the format's number of vertices: a coarser one inside the tile. The edges never depend on the inside: they
// keep the threshold of the error that was asked for, exactly, since scaling by a power of two rounds nothing.
Result<tin::TinMesh> CoarserInside(const tin::HeightField& field, const tin::GreedyOptions& plan, double& error_m,
                                   const std::stop_token& stop) {
  for (double coarser = 2;; coarser *= 2) {
    tin::GreedyOptions options = plan;
    options.record = false;
    for (tin::BorderOptions& border : options.borders) border.scale = coarser;
    tin::GreedyTriangulation greedy(field, std::move(options));
    tin::GreedyGoal goal;
    goal.max_error = error_m * coarser;
    goal.max_points = proto::kMaxTileVertices + 1;
    if (!greedy.Run(goal, stop)) return Cancelled();
    if (greedy.vertex_count() > proto::kMaxTileVertices) continue;
    error_m = goal.max_error;
    return greedy.Mesh();
  }
}

tin::GreedyOptions PlanOf(const dem::DemSource& source, const proto::LatticeView& lattice) {
  return MakeRefinePlan(lattice, EdgeStepsOf(source, lattice.key, proto::kHeightResolution));
}

std::string StrongETag(std::string_view bytes) {
  const XXH128_hash_t hash = XXH3_128bits(bytes.data(), bytes.size());
  return fmt::format("\"{:016x}{:016x}\"", hash.high64, hash.low64);
}

}  // namespace

TilePipeline::TilePipeline(std::vector<Dataset> datasets, std::size_t refinement_cache_bytes)
    : datasets_(std::move(datasets)), refinements_(refinement_cache_bytes) {}

// From the cache where it goes as far as is asked; else read or continued, and kept.
Result<RefinedTilePtr> TilePipeline::Refine(std::uint32_t index, const geo::TileKey& key, double error_m,
                                            StageTimes& times, const std::stop_token& stop) const {
  const Dataset& dataset = datasets_[index];
  const RefinedTileKey cache_key{index, dataset.generation, key};
  const RefinedTilePtr known = refinements_.Find(cache_key);
  if (known && known->error_m <= error_m) return known;

  Clock::time_point start = Clock::now();
  dem::TileHeights heights;
  if (known) {
    heights = known->heights;
  } else {
    Result<dem::TileHeights> read = dataset.source->Read(key, stop);
    if (!read) return tl::unexpected(std::move(read).error());
    heights = *std::move(read);
    times.read = Since(start);
    start = Clock::now();
  }
  const proto::LatticeView lattice{key, heights.lattice, heights.heights};
  const tin::HeightField field = FieldOf(lattice);
  tin::GreedyOptions plan = PlanOf(*dataset.source, lattice);
  tin::GreedyTriangulation greedy = known ? tin::GreedyTriangulation(field, std::move(plan), known->refinement)
                                          : tin::GreedyTriangulation(field, std::move(plan));
  tin::GreedyGoal goal;
  goal.max_error = error_m;
  goal.max_points = proto::kMaxTileVertices + 1;
  if (!greedy.Run(goal, stop)) return Cancelled();
  auto refined = std::make_shared<RefinedTile>(RefinedTile{std::move(heights), greedy.MakeRefinement(), error_m});
  times.refine = Since(start);
  // One that ended at the format's number of vertices holds no mesh to this error.
  if (refined->refinement.vertex_count() <= proto::kMaxTileVertices) {
    refinements_.Insert(cache_key, refined);
  }
  return RefinedTilePtr(std::move(refined));
}

Result<EncodedTile> TilePipeline::Build(const TileRequest& request, std::stop_token stop) const {
  if (request.dataset >= datasets_.size()) return MakeError(ErrorCode::kNotFound, "no such dataset");
  const Dataset& dataset = datasets_[request.dataset];
  if (!dataset.source->IsAvailable(request.key)) {
    return MakeError(ErrorCode::kNotFound, "{}/{}: no such tile", dataset.name, geo::ToString(request.key));
  }
  const double error_m = geo::LadderError(request.key.level, request.error_step, dataset.error_fraction);
  EncodedTile encoded;
  const Result<RefinedTilePtr> refined = Refine(request.dataset, request.key, error_m, encoded.times, stop);
  if (!refined) return tl::unexpected(refined.error());

  Clock::time_point start = Clock::now();
  const dem::TileHeights& heights = (*refined)->heights;
  const proto::LatticeView lattice{request.key, heights.lattice, heights.heights};
  double inside_error_m = error_m;
  Result<tin::TinMesh> mesh = (*refined)->refinement.vertex_count() <= proto::kMaxTileVertices
                                  ? (*refined)->refinement.MeshAt(error_m)
                                  : CoarserInside(FieldOf(lattice), PlanOf(*dataset.source, lattice), inside_error_m, stop);
  if (!mesh) return tl::unexpected(std::move(mesh).error());
  encoded.times.refine += Since(start);

  start = Clock::now();
  Result<MeasuredTile> measured = Finish(*std::move(mesh), lattice, EdgeStepsOf(*dataset.source, request.key, error_m),
                                         inside_error_m, IsCurved(request.key.level, inside_error_m), stop);
  if (!measured) return tl::unexpected(std::move(measured).error());
  if (!proto::AllCounterClockwise(measured->tile)) {
    return MakeError(ErrorCode::kInternal, "{}/{}: a triangle turned over", dataset.name, geo::ToString(request.key));
  }
  if (request.normals) measured->tile.normals = proto::TileNormals(lattice, measured->mesh, measured->tile);
  encoded.bytes = proto::EncodeQuantizedMesh(measured->tile, {.normals = request.normals});
  encoded.times.encode = Since(start);

  if (request.coding == Coding::kGzip) {
    start = Clock::now();
    encoded.bytes = proto::Gzip(encoded.bytes);
    encoded.times.compress = Since(start);
  }
  encoded.etag = StrongETag(encoded.bytes);
  encoded.max_error_m = measured->max_error_m;
  encoded.vertices = static_cast<std::uint32_t>(measured->tile.u.size());
  encoded.triangles = static_cast<std::uint32_t>(measured->tile.triangles.size());
  return encoded;
}

}  // namespace terrace::server
