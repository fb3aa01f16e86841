#include "server/tiles/glb_mesher.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/tin/insert_samples.h"
#include "proto/quantized_mesh.h"
#include "proto/skirt.h"
#include "proto/surface_error.h"
#include "proto/tile_error.h"
#include "proto/tile_normals.h"

namespace terrace::server {
namespace {

using Clock = std::chrono::steady_clock;

// Far coarser than what processors differ by, far finer than light can show: 0.003 degrees.
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
  constexpr int kMaxRounds = 16;  // as for quantized-mesh
  const Clock::time_point start = Clock::now();
  Result<StartedMesh> started = StartMesh(source, lattice, refinement, rules, wanted_error_m, stop);
  if (!started) return tl::unexpected(std::move(started).error());
  MeshedGlb meshed;
  meshed.replayed = std::chrono::duration_cast<std::chrono::microseconds>(Clock::now() - start);

  tin::TinMesh& mesh = started->mesh;
  double step_m = proto::GridStep(lattice.lattice, wanted_error_m, width);
  const double depth_m = proto::SkirtDepth(lattice.key.level, skirt_error_m);
  proto::TileMeter meter(lattice, started->error_m);
  tin::SampleInserter inserter;
  for (int round = 1;; ++round) {
    if (stop.stop_requested()) return Cancelled();
    std::vector<proto::GridPoint> points = proto::SnapVertices(lattice, mesh, step_m);
    while (!proto::FitsFloats(points, step_m, depth_m)) points = proto::SnapVertices(lattice, mesh, step_m *= 2);
    const std::vector<geo::Vec3> positions = proto::GridPositions(points, step_m);
    const proto::TileError error = meter.MeasureFlat(mesh, positions);
    meshed.max_error_m = error.max_m;
    if (error.misses.empty() || round == kMaxRounds ||
        mesh.vertices.size() + error.misses.size() > proto::kMaxTileVertices) {
      meshed.surface_error_m = std::max(error.max_m, proto::MeasureFlatEdgeError(lattice, mesh, positions));
      meshed.mesh = proto::MakeGridMesh(
          lattice, mesh, points, RoundedNormals(proto::VertexNormals(lattice, mesh, positions)), step_m, depth_m);
      return meshed;
    }
    inserter.InsertInto(mesh, error.misses);
  }
}

}  // namespace terrace::server
