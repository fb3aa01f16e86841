// The positions of an area's samples in space, and the distance between flat triangles and the samples.
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/geo/ellipsoid.h"
#include "engine/geo/lattice.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"
#include "proto/error/tile_error.h"

namespace terrace::tiler {

// Rows from the south, columns from the west. Immutable and thread-safe.
class AreaSurface {
 public:
  AreaSurface(const geo::Lattice& lattice, const dem::NodeWindow& window);

  // Degrees; longitudes may lie beyond +-180.
  dem::GeoPosition At(int column, int row) const;
  // Metres, ECEF.
  geo::Vec3 Ecef(int column, int row, double height_m) const;

  // Adds the curvature of the Earth to the options of the run that makes the mesh.
  void AddCurvature(tin::GreedyOptions& options) const;

  // Vertical distances between the samples and the flat triangles with corners in `ecef`, the mesh's vertices.
  // `to_insert` has, for each triangle that exceeds the bound, the worst sample that is no vertex, also on the border:
  // areas have no neighbours that share it. A vertex that exceeds the bound counts with the distance from its own
  // position. `allowed`: the bounds by sample, row by row; empty: `bound_m` everywhere. If `stop` is requested, returns
  // what was measured until then.
  proto::TileError MeasureError(const tin::HeightField& field, const tin::TinMesh& mesh,
                                const std::vector<geo::Vec3>& ecef, double bound_m, std::span<const float> allowed,
                                const std::stop_token& stop) const;

 private:
  geo::Vec3 Up(int column, int row) const;

  const geo::Lattice lattice_;
  const dem::NodeWindow window_;
  std::vector<geo::Vec3> column_normals_, row_normals_;  // of columns, at the equator; of rows, at longitude 0
  std::vector<geo::Vec3> row_points_;                    // of rows: ECEF metres at longitude 0, height 0
};

// Rounds a position to multiples of 2^-10 m. This removes the last bits of libm's results, which differ between
// processors.
geo::Vec3 RoundPosition(geo::Vec3 metres);

}  // namespace terrace::tiler
