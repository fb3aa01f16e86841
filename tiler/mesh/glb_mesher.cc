#include "tiler/mesh/glb_mesher.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "proto/error/surface_error.h"
#include "proto/error/tile_error.h"
#include "proto/mesh/skirt.h"
#include "proto/mesh/tile_normals.h"
#include "tiler/mesh/mend_mesh.h"

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

}  // namespace

Result<MeshedGlb> MeshGlb(const dem::DemSource& source, const proto::LatticeView& lattice,
                          const tin::Refinement& refinement, const MeshRules& rules, double wanted_error_m,
                          double skirt_error_m, proto::PositionWidth width, const std::stop_token& stop) {
  const Clock::time_point start = Clock::now();
  Result<StartedMesh> started = StartMesh(source, lattice, refinement, rules, wanted_error_m, stop);
  if (!started) return tl::unexpected(std::move(started).error());
  MeshedGlb meshed;
  meshed.replayed = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start);

  tin::TinMesh& mesh = started->mesh;
  double step_m = proto::GridStep(lattice.lattice, wanted_error_m, width);
  const double depth_m = proto::SkirtDepth(lattice.key.level, skirt_error_m);
  proto::TileMeter meter(lattice, started->error_m);
  std::vector<proto::GridPoint> points;
  std::vector<geo::Vec3> positions;
  const auto measure = [&](const tin::TinMesh& rounded) {
    points = proto::SnapVertices(lattice, rounded, step_m);
    while (!proto::FitsFloats(points, step_m, depth_m)) points = proto::SnapVertices(lattice, rounded, step_m *= 2);
    positions = proto::GridPositions(points, step_m);
    return meter.MeasureFlat(rounded, positions);
  };
  const Result<proto::TileError> error = MendMesh(mesh, measure, proto::kMaxTileVertices, stop);
  if (!error) return tl::unexpected(error.error());
  meshed.max_error_m = error->max_m;
  meshed.surface_error_m = std::max(error->max_m, proto::MeasureFlatEdgeError(lattice, mesh, positions));
  meshed.mesh = proto::MakeGridMesh(lattice, mesh, points,
                                    RoundedNormals(proto::VertexNormals(lattice, mesh, positions)), step_m, depth_m);
  return meshed;
}

}  // namespace terrace::tiler
