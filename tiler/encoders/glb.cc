#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/elapsed_time.h"
#include "engine/dem/tile_edits.h"
#include "proto/error/surface_error.h"
#include "proto/error/tile_error.h"
#include "proto/gltf/glb_tile.h"
#include "proto/gltf/texture.h"
#include "proto/lattice_angles.h"
#include "proto/mesh/grid_mesh.h"
#include "proto/mesh/skirt.h"
#include "proto/mesh/tile_normals.h"
#include "tiler/encoders.h"
#include "tiler/mesh/edit_limits.h"
#include "tiler/mesh/restore_error_bound.h"
#include "tiler/mesh/tile_mesher.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {
namespace {

using Clock = std::chrono::steady_clock;

// 0.003 degrees: much larger than differences between processors, much smaller than visible in shading.
double RoundNormal(double component) {
  constexpr double kGrid = 16384;
  return std::floor(component * kGrid + 0.5) / kGrid;
}

std::vector<geo::Vec3> RoundedNormals(std::vector<geo::Vec3> normals) {
  for (geo::Vec3& n : normals) n = {RoundNormal(n.x), RoundNormal(n.y), RoundNormal(n.z)};
  return normals;
}

struct MeshedGlb {
  proto::GridMesh mesh;                     // with normals and skirts
  double max_error_m = 0;                   // of the flat triangles, measured on the grid points
  double surface_error_m = 0;               // the same everywhere, not only at the lattice's samples
  std::chrono::microseconds replay_time{};  // of ReplayMesh
  tin::TinMesh tin;                         // without skirts
  std::vector<geo::Vec3> positions;         // of its vertices
  std::vector<std::uint8_t> in_hole;        // by its triangles (edit_limits.h)
};

// Starts from the same mesh as a quantized-mesh tile of this error (ReplayMesh), and rounds its vertices to the
// grid of proto/mesh/grid_mesh.h. Measures the result, and inserts samples where rounding has pushed one over the
// bound. Edges do not change: they are refined to 15/16 of the error, and the grid's rounding takes less than the rest.
// `refinement`: as for MeshTile. `skirt_error_m`: determines the depth of skirts (proto/mesh/skirt.h), as in tilesets.
// kCancelled: stopped.
Result<MeshedGlb> MeshGlb(const Dataset& dataset, const proto::TileSamples& samples,
                          const std::optional<tin::Refinement>& refinement, double wanted_error_m, double skirt_error_m,
                          proto::PositionWidth width, const std::stop_token& stop) {
  const Clock::time_point start = Clock::now();
  Result<ReplayedMesh> replayed =
      ReplayMesh(*dataset.model, samples, refinement, dataset.mesh_options, wanted_error_m, stop);
  if (!replayed) return tl::unexpected(std::move(replayed).error());
  MeshedGlb meshed;
  meshed.replay_time = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start);

  tin::TinMesh& mesh = replayed->mesh;
  const dem::MeshDemands demands = dem::TileEdits(*dataset.model).DemandsOf(samples.key);
  const tin::SampleLimits limits = LimitsOf(demands);
  std::vector<float> allowed = AllowedErrors(limits, replayed->error_m);
  double min_m = wanted_error_m;
  for (const float error_m : allowed) min_m = std::min(min_m, static_cast<double>(error_m));
  proto::GridSteps steps(samples.lattice, EdgeErrorsOf(*dataset.model, samples.key, limits, wanted_error_m), min_m,
                         width);
  double& step_m = steps.inside;
  const double depth_m = proto::SkirtDepth(samples.key.level, skirt_error_m);
  proto::TileErrorMeter meter(samples, replayed->error_m, std::move(allowed));
  std::vector<proto::GridPoint> points;
  std::vector<geo::Vec3> positions;
  const auto measure = [&](const tin::TinMesh& candidate) {
    points = proto::SnapVertices(samples, candidate, steps);
    while (!proto::FitsFloats(points, step_m, depth_m)) {
      steps.Double();
      points = proto::SnapVertices(samples, candidate, steps);
    }
    positions = proto::GridPositions(points, step_m);
    return meter.MeasureFlat(candidate, positions);
  };
  const Result<proto::TileError> error = RestoreErrorBound(mesh, measure, proto::kMaxTileVertices, stop);
  if (!error) return tl::unexpected(error.error());
  meshed.max_error_m = error->max_m;
  meshed.surface_error_m = proto::MeasureFlatSurfaceError(samples, mesh, positions, error->max_m);
  meshed.in_hole = TrianglesInHoles(demands, samples.cells() + 1, mesh);
  meshed.mesh =
      proto::MakeGridMesh(samples, mesh, points, RoundedNormals(proto::VertexNormals(samples, mesh, positions)), step_m,
                          depth_m, meshed.in_hole);
  meshed.tin = std::move(mesh);
  meshed.positions = std::move(positions);
  return meshed;
}

// Cuts the texture of the requested tile from the imagery and adds it to `options`. Does nothing if no texture is
// requested or the image shows no part of the tile.
Result<void> AddTexture(const ImageryOptions& imagery, const TileRequest& request, proto::GlbOptions& options,
                        const std::stop_token& stop) {
  options.texture = std::nullopt;
  if (!imagery.image || request.texture == proto::TextureFormat::kNone) return {};
  const int side = imagery.image->SideOf(request.key.level, imagery.side);
  const Result<std::optional<dem::TilePicture>> picture = imagery.image->Read(request.key, side, stop);
  if (!picture) return tl::unexpected(picture.error());
  if (!*picture) return {};
  Result<std::string> bytes = proto::EncodePicture((*picture)->rgb, side, side, request.texture, imagery.quality);
  if (!bytes) return tl::unexpected(std::move(bytes).error());
  options.texture = proto::GlbTexture{*std::move(bytes), proto::MediaTypeOf(request.texture)};
  // Clients split credits at semicolons (CesiumJS, cesium-native).
  if (!options.copyright.empty() && !imagery.attribution.empty()) options.copyright += "; ";
  options.copyright += imagery.attribution;
  return {};
}

Result<MeshedGlb> MeshGlb(const EncoderInput& input, const std::stop_token& stop) {
  const auto& [dataset, request, refined, error_m] = input;
  const bool is_deepest = request.key.level >= dataset.model->max_source_level();
  const double skirt_error_m =
      proto::SkirtError(request.key.level, request.error_step, is_deepest, dataset.error_fraction);
  proto::TileSamples samples = input.samples();
  const proto::LatticeAngles angles(samples);
  samples.angles = &angles;
  return MeshGlb(dataset, samples, refined->refinement, error_m, skirt_error_m, proto::WidthOf(request.compression),
                 stop);
}

}  // namespace

Result<DrawnTriangles> GlbTriangles(const EncoderInput& input, const std::stop_token& stop) {
  Result<MeshedGlb> meshed = MeshGlb(input, stop);
  if (!meshed) return tl::unexpected(std::move(meshed).error());
  DrawnTriangles drawn;
  const double cells = input.samples().cells();
  for (const tin::SamplePosition& vertex : meshed->tin.vertices)
    drawn.places.push_back({vertex.x / cells, vertex.y / cells});
  drawn.positions = std::move(meshed->positions);
  drawn.in_hole = std::move(meshed->in_hole);
  drawn.triangles = std::move(meshed->tin.triangles);
  return drawn;
}

Result<void> MakeGlbTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  const auto& [dataset, request, refined, error_m] = input;
  const auto start = Clock::now();
  const Result<MeshedGlb> meshed = MeshGlb(input, stop);
  if (!meshed) return tl::unexpected(meshed.error());
  proto::GlbOptions options = dataset.glb;
  options.compression = request.compression;
  options.copyright = dataset.attribution;
  options.max_error_m = meshed->max_error_m;
  options.certified_error_m = meshed->surface_error_m + refined->heights.source_error_m;
  if (const Result<void> added = AddTexture(dataset.imagery, request, options, stop); !added) {
    return tl::unexpected(added.error());
  }
  Result<proto::GlbTile> glb = proto::EncodeGlb(meshed->mesh, options);
  if (!glb) return tl::unexpected(std::move(glb).error());
  encoded.bytes = std::move(glb->bytes);
  encoded.times.refine += meshed->replay_time;
  encoded.times.encode = MicrosecondsSince(start) - meshed->replay_time;
  encoded.max_error_m = meshed->max_error_m;
  encoded.certified_error_m = options.certified_error_m;
  encoded.vertices = glb->vertices;
  encoded.triangles = glb->triangles;
  return {};
}

}  // namespace terrace::tiler
