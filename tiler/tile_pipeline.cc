#include "tiler/tile_pipeline.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/elapsed_time.h"
#include "engine/dem/tile_edits.h"
#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_cover.h"
#include "engine/tin/greedy.h"
#include "proto/gltf/glb_tile.h"
#include "proto/mesh/position_width.h"
#include "tiler/encoders.h"
#include "tiler/mesh/error_allowed_at_samples.h"
#include "tiler/mesh/refine_options.h"
#include "tiler/mesh/tile_mesher.h"
#include "tiler/store/baked_tiles.h"
#include "tiler/store/refinement_cache.h"
#include "tiler/surface/drawn_mesh_cache.h"
#include "tiler/surface/drawn_points.h"
#include "tiler/surface/drawn_sight.h"
#include "tiler/surface/quantized_mesh_triangles.h"
#include "tiler/surface/source_normals.h"
#include "tiler/tile/check_request.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::tiler {
namespace {

using Clock = std::chrono::steady_clock;

// A tile of a dataset without sources, from its archive.
Result<EncodedTile> TakeBaked(const Dataset& dataset, const TileRequest& request) {
  Result<std::optional<EncodedTile>> found = dataset.baked->Find(request);
  if (!found) return tl::unexpected(std::move(found.error()));
  if (!*found) return tl::unexpected(dataset.baked->WhyAbsent(request));
  return **std::move(found);
}

bool HasBakedMeshes(const Dataset& dataset) {
  const std::vector<TileFormat>& formats = dataset.baked->extent().formats;
  return std::ranges::find(formats, TileFormat::kQuantizedMesh) != formats.end();
}

tl::unexpected<Error> NoSources(const Dataset& dataset) {
  return MakeError(
      ErrorCode::kNotFound, "the dataset is an archive of finished tiles without its sources, which this needs{}",
      HasBakedMeshes(dataset) ? "; heights of the tiles themselves are available with surface=served" : "");
}

// Whether an archive has the tiles that a drawn surface is read from. GLB tiles of archives are not decoded.
Result<void> CheckHasSurface(const Dataset& dataset, const DrawnSurface& surface) {
  if (dataset.model) return {};
  const bool has = HasBakedMeshes(dataset);
  if (has && surface.format == TileFormat::kQuantizedMesh) return {};
  return MakeError(ErrorCode::kNotFound,
                   "the dataset is an archive of finished tiles alone, and its heights are read from quantized-mesh "
                   "tiles: {}",
                   has ? "leave out the parameter format" : "it has none");
}

// Gives datasets without a generation their number.
std::vector<Dataset> Numbered(std::vector<Dataset> datasets) {
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    if (datasets[i].generation == 0) datasets[i].generation = i + 1;
  }
  return datasets;
}

const std::vector<std::vector<geo::TileRange>>& AvailableIn(const Dataset& dataset) {
  return dataset.model ? dataset.model->Availability() : dataset.baked->extent().available;
}

int DeepestOf(const Dataset& dataset) { return static_cast<int>(AvailableIn(dataset).size()) - 1; }

HasTile AvailabilityOf(const Dataset& dataset) {
  return [&available = AvailableIn(dataset)](const geo::TileKey& key) { return geo::IsAvailable(available, key); };
}

// Returns the cached refinement if it reaches the error. Else continues it, or reads heights and refines them. Caches
// the result if it reaches the error. `encoded`: gets times and refinement_use; nothing is encoded here.
Result<RefinedTilePtr> Refine(RefinementCache& refinements, const Dataset& dataset, const geo::TileKey& key,
                              double error_m, EncodedTile& encoded, const std::stop_token& stop) {
  const RefinedTileKey cache_key{dataset.cache_generation(), key, dem::TileEdits(*dataset.model).Hash(key)};
  const RefinedTilePtr known = refinements.Find(cache_key);
  encoded.refinement_use = known ? RefinementUse::kContinued : RefinementUse::kMade;
  if (known && known->error_m <= error_m) {
    encoded.refinement_use = RefinementUse::kReplayed;
    return known;
  }

  Clock::time_point start = Clock::now();
  dem::TileHeights heights;
  if (known) {
    heights = known->heights;
  } else {
    Result<dem::TileHeights> read = dataset.model->Read(key, stop);
    if (!read) return tl::unexpected(std::move(read).error());
    heights = *std::move(read);
    encoded.times.read = MicrosecondsSince(start);
    start = Clock::now();
  }
  const proto::TileSamples samples{key, heights.lattice, heights.heights};
  const tin::HeightField field = FieldOf(samples);
  tin::GreedyOptions options = RefineOptionsOf(*dataset.model, samples, dataset.mesh_options.criterion);
  tin::GreedyTriangulation greedy = known ? tin::GreedyTriangulation(field, std::move(options), *known->refinement)
                                          : tin::GreedyTriangulation(field, std::move(options));
  tin::GreedyGoal goal;
  goal.max_error = error_m;
  // One more than a tile may have, so that a run that this limit ended has no refinement.
  goal.max_points = proto::kMaxTileVertices + 1;
  static_assert(tin::Refinement::kMaxVertices == proto::kMaxTileVertices);
  if (!greedy.Run(goal, stop)) return Cancelled();
  auto refined = std::make_shared<RefinedTile>(RefinedTile{std::move(heights), greedy.MakeRefinement(), error_m});
  encoded.times.refine = MicrosecondsSince(start);
  // A refinement is not kept if it is no better than what another build has stored meanwhile.
  const RefinedTilePtr other = refinements.FindInMemory(cache_key);
  if (refined->refinement && !(other && other->error_m <= error_m)) {
    refinements.Insert(cache_key, refined);
  }
  return RefinedTilePtr(std::move(refined));
}

// The triangles that a client decodes from the tile of the request, which is quantized-mesh or GLB.
Result<DrawnTriangles> TrianglesOf(RefinementCache& refinements, const Dataset& dataset, const TileRequest& request,
                                   const std::stop_token& stop) {
  if (!dataset.model) {
    const Result<EncodedTile> baked = TakeBaked(dataset, request);
    if (!baked) return tl::unexpected(baked.error());
    return DecodeTriangles(baked->bytes, request.key);
  }
  const double error_m =
      ErrorAllowedAtSamples(geo::LadderError(request.key.level, request.error_step, dataset.error_fraction));
  EncodedTile encoded;
  Result<RefinedTilePtr> refined = Refine(refinements, dataset, request.key, error_m, encoded, stop);
  if (!refined) return tl::unexpected(std::move(refined).error());
  const EncoderInput input{dataset, request, refined->get(), error_m};
  return request.format == TileFormat::kGlb ? GlbTriangles(input, stop) : QuantizedMeshTriangles(input, stop);
}

// Returns a function that finds the meshes of a surface, or makes them. It must not outlive the arguments.
FindMesh MeshFinder(DrawnMeshCache& drawn, RefinementCache& refinements, const Dataset& dataset,
                    const DrawnSurface& surface, const std::stop_token& stop) {
  return [&drawn, &refinements, &dataset, &surface,
          &stop](const geo::TileKey& key) -> Result<std::shared_ptr<const DrawnMesh>> {
    TileRequest request;
    request.key = key;
    request.error_step = geo::ErrorStep(surface.requested, key.level, dataset.error_scale());
    request.format = surface.format;
    const bool is_glb = surface.format == TileFormat::kGlb;
    if (is_glb) request.compression = surface.compression.value_or(dataset.glb.compression);
    const DrawnMeshKey cache_key{dataset.generation, key, request.error_step, is_glb,
                                 is_glb ? proto::WidthOf(request.compression) : proto::PositionWidth::kFloat};
    if (std::shared_ptr<const DrawnMesh> known = drawn.Find(cache_key)) return known;
    Result<DrawnTriangles> triangles = TrianglesOf(refinements, dataset, request, stop);
    if (!triangles) return tl::unexpected(std::move(triangles).error());
    auto mesh = std::make_shared<const DrawnMesh>(key, *std::move(triangles));
    drawn.Insert(cache_key, mesh);
    return mesh;
  };
}

}  // namespace

TilePipeline::TilePipeline(std::vector<Dataset> datasets, std::size_t refinement_cache_bytes)
    : TilePipeline(std::move(datasets), std::make_shared<RefinementCache>(refinement_cache_bytes)) {}

TilePipeline::TilePipeline(std::vector<Dataset> datasets, std::shared_ptr<RefinementCache> refinements)
    : datasets_(Numbered(std::move(datasets))),
      drawn_(std::make_unique<DrawnMeshCache>(kDrawnMeshBytes)),
      refinements_(std::move(refinements)) {}

TilePipeline::~TilePipeline() = default;

CacheStats TilePipeline::drawn_meshes() const { return drawn_->stats(); }
CacheStats TilePipeline::refinements() const { return refinements_->stats(); }

Result<const Dataset*> TilePipeline::Find(std::uint32_t dataset) const {
  if (dataset >= datasets_.size()) return MakeError(ErrorCode::kNotFound, "there is no dataset {}", dataset);
  return &datasets_[dataset];
}

Result<const dem::ElevationModel*> TilePipeline::FindModel(std::uint32_t dataset) const {
  const Result<const Dataset*> found = Find(dataset);
  if (!found) return tl::unexpected(found.error());
  if (!(*found)->model) return NoSources(**found);
  return (*found)->model.get();
}

Result<EncodedTile> TilePipeline::Build(const TileRequest& request, std::stop_token stop) const {
  const Result<const Dataset*> found = Find(request.dataset);
  if (!found) return tl::unexpected(found.error());
  if (const Result<void> valid = CheckRequest(request); !valid) return tl::unexpected(valid.error());
  const Dataset& dataset = **found;
  if (!dataset.model) return TakeBaked(dataset, request);
  const auto* const encoder = std::ranges::find(kEncoders, request.format, &Encoder::format);
  TERRACE_CHECK(encoder != std::end(kEncoders));
  EncodedTile encoded;
  RefinedTilePtr refined;
  double error_m = 0;
  if (encoder->needs_refinement) {
    if (!dataset.model->IsAvailable(request.key)) {
      return MakeError(ErrorCode::kNotFound, "{}/{}: no such tile", dataset.name, geo::ToString(request.key));
    }
    error_m = ErrorAllowedAtSamples(geo::LadderError(request.key.level, request.error_step, dataset.error_fraction));
    Result<RefinedTilePtr> made = Refine(*refinements_, dataset, request.key, error_m, encoded, stop);
    if (!made) return tl::unexpected(std::move(made).error());
    refined = *std::move(made);
  }
  const Result<void> done = encoder->encode({dataset, request, refined.get(), error_m}, encoded, stop);
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

Result<PointHeights> TilePipeline::ReadPoints(std::uint32_t dataset, std::span<const dem::GeoPosition> points,
                                              dem::HeightDatum datum, std::stop_token stop) const {
  const Result<const dem::ElevationModel*> model = FindModel(dataset);
  if (!model) return tl::unexpected(model.error());
  std::vector<std::uint8_t> filled(points.size());
  Result<std::vector<float>> heights = (*model)->ReadPoints(points, datum, std::move(stop), filled);
  if (!heights) return tl::unexpected(std::move(heights).error());
  return PointHeights{*std::move(heights), std::move(filled)};
}

Result<std::vector<std::array<float, 3>>> TilePipeline::ReadNormals(std::uint32_t dataset,
                                                                    std::span<const dem::GeoPosition> points,
                                                                    std::stop_token stop) const {
  const Result<const dem::ElevationModel*> model = FindModel(dataset);
  if (!model) return tl::unexpected(model.error());
  return SourceNormals(**model, points, stop);
}

Result<PointHeights> TilePipeline::ReadDrawnPoints(std::uint32_t dataset, const DrawnSurface& surface,
                                                   std::span<const dem::GeoPosition> points, bool normals,
                                                   std::stop_token stop) const {
  const Result<const Dataset*> found = Find(dataset);
  if (!found) return tl::unexpected(found.error());
  const Dataset& known = **found;
  if (const Result<void> has = CheckHasSurface(known, surface); !has) return tl::unexpected(has.error());
  const Result<int> level = LevelOf(surface, DeepestOf(known), known.error_fraction);
  if (!level) return tl::unexpected(level.error());
  std::vector<dem::GeoPosition> wrapped(points.begin(), points.end());
  for (dem::GeoPosition& point : wrapped) {
    if (std::abs(point.longitude) > 180) point.longitude = std::remainder(point.longitude, 360);
  }
  return tiler::ReadDrawnPoints(AvailabilityOf(known), *level, wrapped, normals,
                                MeshFinder(*drawn_, *refinements_, known, surface, stop), stop);
}

Result<std::vector<dem::SightAnswer>> TilePipeline::LookAlong(std::uint32_t dataset,
                                                              const std::optional<DrawnSurface>& surface,
                                                              std::span<const dem::SightRay> rays,
                                                              const dem::SightOptions& options,
                                                              std::stop_token stop) const {
  const Result<const Dataset*> found = Find(dataset);
  if (!found) return tl::unexpected(found.error());
  const Dataset& known = **found;
  if (!known.model && !surface) return NoSources(known);
  if (known.model) {
    if (const Result<void> bounded = CheckSamplesAlong(*known.model, rays); !bounded)
      return tl::unexpected(bounded.error());
    if (!surface) return known.model->LookAlong(rays, options, std::move(stop));
  }
  if (const Result<void> has = CheckHasSurface(known, *surface); !has) return tl::unexpected(has.error());
  const Result<int> level = LevelOf(*surface, DeepestOf(known), known.error_fraction);
  if (!level) return tl::unexpected(level.error());
  if (!known.model) {
    if (const Result<void> bounded = CheckSamplesAlong(*level, rays); !bounded) return tl::unexpected(bounded.error());
  }
  return LookAlongDrawn(AvailabilityOf(known), *level, rays, options,
                        MeshFinder(*drawn_, *refinements_, known, *surface, stop), stop);
}

Result<AreaPlan> TilePipeline::PlanArea(std::uint32_t dataset, const AreaRequest& area, std::size_t max_samples) const {
  const Result<const dem::ElevationModel*> model = FindModel(dataset);
  if (!model) return tl::unexpected(model.error());
  return tiler::PlanArea(**model, datasets_[dataset].error_fraction, area, max_samples);
}

Result<EncodedTile> TilePipeline::BuildArea(std::uint32_t dataset, const AreaPlan& plan, const AreaRequest& area,
                                            std::stop_token stop) const {
  const Result<const dem::ElevationModel*> model = FindModel(dataset);
  if (!model) return tl::unexpected(model.error());
  return BuildAreaMesh(**model, plan, area, std::move(stop));
}

}  // namespace terrace::tiler
