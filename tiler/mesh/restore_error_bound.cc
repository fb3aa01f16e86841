#include "tiler/mesh/restore_error_bound.h"

#include "engine/tin/sample_inserter.h"
#include "tiler/mesh/tile_mesher.h"

namespace terrace::tiler {
namespace {

// Every round but the last inserts a sample.
Result<proto::TileError> InsertUntilBoundHolds(tin::TinMesh& mesh, const MeasureMesh& measure, std::size_t max_vertices,
                                               const std::stop_token& stop) {
  tin::SampleInserter inserter;
  for (;;) {
    if (stop.stop_requested()) return Cancelled();
    proto::TileError measured = measure(mesh);
    if (measured.to_insert.empty() || mesh.vertices.size() + measured.to_insert.size() > max_vertices) return measured;
    inserter.InsertInto(mesh, measured.to_insert);
  }
}

}  // namespace

// In a Delaunay triangulation, a vertex is joined to its four neighbours if they are vertices, because the circle over
// each of these edges is empty. In other triangulations an edge may pass between them (is_cut_through): then the mesh
// is made Delaunay.
Result<proto::TileError> RestoreErrorBound(tin::TinMesh& mesh, const MeasureMesh& measure, std::size_t max_vertices,
                                           const std::stop_token& stop) {
  Result<proto::TileError> measured = InsertUntilBoundHolds(mesh, measure, max_vertices, stop);
  if (!measured || !measured->is_cut_through) return measured;
  mesh = tin::DelaunayOf(mesh);
  return InsertUntilBoundHolds(mesh, measure, max_vertices, stop);
}

}  // namespace terrace::tiler
