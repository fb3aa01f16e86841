// One mesh of a requested area, as a file for other programs.
#pragma once

#include <cstdint>
#include <stop_token>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "proto/gltf/gltf_types.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {

// What the x, y and z of a vertex are. OBJ and PLY files store them directly. glTF is y-up: in a GLB file, the vertex
// is at (x, z, -y) after the matrix of its node is applied.
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

// The samples that an area is meshed from: nodes of one level's lattice. The level is the first whose default error is
// at most the requested error, or the sources' deepest. Levels that edits added are used only if they have all tiles of
// the area and need at most `max_samples`. The area is clipped to the model's bounds, then extended to whole cells.
struct AreaPlan {
  int level = 0;
  bool depends_on_limit = false;  // the level may be another one for another `max_samples`
  dem::NodeWindow window;
  dem::GeoPosition centre;  // of the clipped area: the origin of kEnu
};

// kInvalidArgument, with a message for the client: a value that AreaRequest does not permit; the area does not
// intersect the model; it intersects the model in two parts, one on each side of longitudes that the model does not
// cover; it needs more than `max_samples`, or more than 32,768 samples on a side.
Result<AreaPlan> PlanArea(const dem::ElevationModel& model, double error_fraction, const AreaRequest& area,
                          std::size_t max_samples);

// Reads, meshes, measures and encodes. EncodedTile::max_error_m is the largest vertical distance between a sample and
// the flat triangles. Triangles in holes count, too, although the file does not have them. All triangles are flat in
// the file's coordinates: in space, or for kGeographic in longitude, latitude and height. In space, positions of
// vertices are rounded to 2^-10 m. A sample that is a vertex counts with its distance from the rounded position if that
// is smaller: beside a nearly upright triangle, a small shift makes the vertical distance large. Rounding to 32 bits in
// a GLB is not included. Precondition: `plan` is PlanArea's for this model and area. kInvalidArgument: all of the area
// lies in a hole that edits cut, or the mesh exceeds the limits of the file format. Other errors: those of
// ElevationModel::ReadNodes.
Result<EncodedTile> BuildAreaMesh(const dem::ElevationModel& model, const AreaPlan& plan, const AreaRequest& area,
                                  std::stop_token stop);

}  // namespace terrace::tiler
