// One mesh of a requested area, as a file for other programs.
#pragma once

#include <cstdint>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "proto/gltf/gltf_types.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {

// The x, y and z of vertices in OBJ and PLY files. glTF is y-up: in a GLB file, the matrix of the node places the
// vertex at (x, z, -y).
enum class AreaCoordinates : std::uint8_t {
  kEnu,        // metres east, north and up of the area's centre on the ellipsoid
  kEcef,       // EPSG:4978
  kGeographic  // degrees east and north, metres up
};

// Degrees, -180 <= west <= 180, west < east <= west + 360, -90 <= south < north <= 90. East is above 180 if the area
// crosses the antimeridian.
struct AreaRequest {
  double west = 0, south = 0, east = 0, north = 0;
  double error_m = 1;  // finite, > 0
  proto::MeshFileFormat format = proto::MeshFileFormat::kGlb;
  AreaCoordinates coordinates = AreaCoordinates::kEnu;
};

// The samples that an area is meshed from: nodes of one level's lattice. The area is clipped to the model's bounds,
// then extended to whole cells. The level is the first whose default error is at most the requested error, or the
// sources' deepest. A level that edits added is used only if it has all tiles of the area and needs at most
// `max_samples`.
struct AreaPlan {
  int level = 0;
  bool depends_on_limit = false;  // the level may be another one for another `max_samples`
  dem::NodeWindow window;
  dem::GeoPosition centre;  // of the clipped area: the origin of kEnu
};

// kInvalidArgument, with a message for the client:
// - a value that AreaRequest does not permit
// - an area that does not intersect the model, or intersects it in two parts with a range of longitudes between them
//   that the model does not cover
// - an area that needs more than `max_samples`, or more than 32,768 samples on a side
Result<AreaPlan> PlanArea(const dem::ElevationModel& model, double error_fraction, const AreaRequest& area,
                          std::size_t max_samples);

// Reads, meshes, measures and encodes. Triangles are flat in the file's coordinates: in space, or for kGeographic in
// longitude, latitude and height. In space, vertices are rounded to 2^-10 m.
//
// EncodedTile::max_error_m is the largest vertical distance between a sample and these triangles. Triangles in holes
// count too, although the file does not have them. For a sample that is a vertex, the smaller of two distances counts:
// to the triangles, and to the rounded position of the vertex. The reason: rounding moves a vertex sideways, and beside
// a steep triangle the vertical distance is then large. Rounding to 32 bits in a GLB is not included.
//
// Precondition: `plan` is PlanArea's for this model and area. kInvalidArgument: all of the area lies in a hole that
// edits cut, or the mesh exceeds the limits of the file format. Other errors: those of ElevationModel::ReadNodes.
Result<EncodedTile> BuildAreaMesh(const dem::ElevationModel& model, const AreaPlan& plan, const AreaRequest& area,
                                  std::stop_token stop);

}  // namespace terrace::tiler
