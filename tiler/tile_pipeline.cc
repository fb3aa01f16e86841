#include "tiler/tile_pipeline.h"

#include <algorithm>
#include <utility>

#include "engine/geo/error_ladder.h"
#include "engine/tin/greedy.h"
#include "proto/mesh/quantized_mesh.h"
#include "proto/mesh/skirt.h"
#include "proto/mesh/tile_normals.h"
#include "tiler/height_tile.h"
#include "tiler/mesh/glb_mesher.h"
#include "tiler/mesh/tile_mesher.h"
#include "tiler/strong_etag.h"
#include "tiler/tile_extensions.h"
#include "tiler/tile_texture.h"

namespace terrace::tiler {
namespace {

using Clock = std::chrono::steady_clock;

// The error bound of a tile's mesh that keeps `error_m` to the ground: heights at nodes are rounded to 2^-10 m, and
// their positions are inexact.
double MeshError(double error_m) {
  constexpr double kRounding = 0x1p-11 + 0x1p-14;
  return std::max(error_m - kRounding, error_m / 2);
}

}  // namespace

TilePipeline::TilePipeline(std::vector<Dataset> datasets, std::size_t refinement_cache_bytes)
    : TilePipeline(std::move(datasets), std::make_shared<RefinementCache>(refinement_cache_bytes)) {}

TilePipeline::TilePipeline(std::vector<Dataset> datasets, std::shared_ptr<RefinementCache> refinements)
    : datasets_(std::move(datasets)), refinements_(std::move(refinements)) {}

// Returns the cached refinement if it reaches the error; else reads or continues it, and caches the result.
Result<RefinedTilePtr> TilePipeline::Refine(const Dataset& dataset, const geo::TileKey& key, double error_m,
                                            EncodedTile& encoded, const std::stop_token& stop) const {
  const RefinedTileKey cache_key{dataset.generation, key};
  const RefinedTilePtr known = refinements_->Find(cache_key);
  if (known) encoded.refinement = RefinementUse::kContinued;
  if (known && known->error_m <= error_m) {
    encoded.refinement = RefinementUse::kReplayed;
    return known;
  }

  Clock::time_point start = Clock::now();
  dem::TileHeights heights;
  if (known) {
    heights = known->heights;
  } else {
    Result<dem::TileHeights> read = dataset.source->Read(key, stop);
    if (!read) return tl::unexpected(std::move(read).error());
    heights = *std::move(read);
    encoded.times.read = MicrosecondsSince(start);
    start = Clock::now();
  }
  const proto::LatticeView lattice{key, heights.lattice, heights.heights};
  const tin::HeightField field = FieldOf(lattice);
  tin::GreedyOptions plan = PlanOf(*dataset.source, lattice, dataset.rules.criterion);
  tin::GreedyTriangulation greedy = known ? tin::GreedyTriangulation(field, std::move(plan), known->refinement)
                                          : tin::GreedyTriangulation(field, std::move(plan));
  tin::GreedyGoal goal;
  goal.max_error = error_m;
  goal.max_points = proto::kMaxTileVertices + 1;
  if (!greedy.Run(goal, stop)) return Cancelled();
  auto refined = std::make_shared<RefinedTile>(RefinedTile{std::move(heights), greedy.MakeRefinement(), error_m});
  encoded.times.refine = MicrosecondsSince(start);
  // A refinement that ended at the format's limit of vertices does not reach the error. Another build may have stored a
  // longer one meanwhile.
  const RefinedTilePtr other = refinements_->FindInMemory(cache_key);
  if (refined->refinement.vertex_count() <= proto::kMaxTileVertices && !(other && other->error_m <= error_m)) {
    refinements_->Insert(cache_key, refined);
  }
  return RefinedTilePtr(std::move(refined));
}

Result<void> TilePipeline::EncodeQuantizedMesh(const TileRequest& request, const RefinedTile& refined, double error_m,
                                               EncodedTile& encoded, const std::stop_token& stop) const {
  const Dataset& dataset = datasets_[request.dataset];
  const Clock::time_point start = Clock::now();
  const proto::LatticeView lattice{request.key, refined.heights.lattice, refined.heights.heights};
  Result<MeshedTile> measured = MeshTile(*dataset.source, lattice, refined.refinement, dataset.rules, error_m, stop);
  if (!measured) return tl::unexpected(std::move(measured).error());
  if (request.normals) measured->tile.normals = proto::TileNormals(lattice, measured->mesh, measured->tile);
  const Result<proto::QuantizedMeshOptions> options = AddExtensions(dataset, request, lattice, measured->tile, stop);
  if (!options) return tl::unexpected(options.error());
  encoded.bytes = proto::EncodeQuantizedMesh(measured->tile, *options);
  encoded.times.refine += measured->replayed;
  encoded.times.encode = MicrosecondsSince(start) - measured->replayed;
  encoded.max_error_m = measured->max_error_m;
  encoded.certified_error_m = measured->surface_error_m + refined.heights.source_error_m;
  encoded.vertices = static_cast<std::uint32_t>(measured->tile.u.size());
  encoded.triangles = static_cast<std::uint32_t>(measured->tile.triangles.size());
  return {};
}

Result<void> TilePipeline::EncodeGlb(const TileRequest& request, const RefinedTile& refined, double error_m,
                                     EncodedTile& encoded, const std::stop_token& stop) const {
  const Dataset& dataset = datasets_[request.dataset];
  const Clock::time_point start = Clock::now();
  const proto::LatticeView lattice{request.key, refined.heights.lattice, refined.heights.heights};
  const bool is_deepest = request.key.level == dataset.source->max_level();
  const double skirt_error_m =
      proto::SkirtError(request.key.level, request.error_step, is_deepest, dataset.error_fraction);
  const Result<MeshedGlb> meshed = MeshGlb(*dataset.source, lattice, refined.refinement, dataset.rules, error_m,
                                           skirt_error_m, proto::WidthOf(request.compression), stop);
  if (!meshed) return tl::unexpected(meshed.error());
  proto::GlbOptions options = dataset.glb;
  options.compression = request.compression;
  options.copyright = dataset.attribution;
  options.max_error_m = meshed->max_error_m;
  options.certified_error_m = meshed->surface_error_m + refined.heights.source_error_m;
  if (const Result<void> added = AddTexture(dataset.imagery, request, options, stop); !added) {
    return tl::unexpected(added.error());
  }
  Result<proto::GlbTile> glb = proto::EncodeGlb(meshed->mesh, options);
  if (!glb) return tl::unexpected(std::move(glb).error());
  encoded.bytes = std::move(glb->bytes);
  encoded.times.refine += meshed->replayed;
  encoded.times.encode = MicrosecondsSince(start) - meshed->replayed;
  encoded.max_error_m = meshed->max_error_m;
  encoded.certified_error_m = options.certified_error_m;
  encoded.vertices = glb->vertices;
  encoded.triangles = glb->triangles;
  return {};
}

Result<EncodedTile> TilePipeline::Build(const TileRequest& request, std::stop_token stop) const {
  if (request.dataset >= datasets_.size()) return MakeError(ErrorCode::kNotFound, "no such dataset");
  const Dataset& dataset = datasets_[request.dataset];
  if (request.format == TileFormat::kHeightPng) return BuildHeightTile(*dataset.source, request, stop);
  if (!dataset.source->IsAvailable(request.key)) {
    return MakeError(ErrorCode::kNotFound, "{}/{}: no such tile", dataset.name, geo::ToString(request.key));
  }
  const double error_m = MeshError(geo::LadderError(request.key.level, request.error_step, dataset.error_fraction));
  EncodedTile encoded;
  const Result<RefinedTilePtr> refined = Refine(dataset, request.key, error_m, encoded, stop);
  if (!refined) return tl::unexpected(refined.error());

  const Result<void> done = request.format == TileFormat::kGlb
                                ? EncodeGlb(request, **refined, error_m, encoded, stop)
                                : EncodeQuantizedMesh(request, **refined, error_m, encoded, stop);
  if (!done) return tl::unexpected(done.error());

  if (request.coding != Coding::kIdentity) {
    const Clock::time_point start = Clock::now();
    encoded.bytes = Compress(std::move(encoded.bytes), request.coding, stop);
    if (stop.stop_requested()) return Cancelled();
    encoded.times.compress = MicrosecondsSince(start);
  }
  encoded.etag = StrongETag(encoded.bytes);
  return encoded;
}

}  // namespace terrace::tiler
