// Meshes as files that other programs open: Wavefront OBJ, PLY and binary glTF, with a colour at every vertex or none.
//
// OBJ is text; its numbers read back to the same doubles. PLY is binary little-endian doubles. Both store x, y, z
// directly. GLB has 32-bit floats and a double-precision matrix in its node. If the vertices lie on a raster's grid,
// the floats are columns, rows and heights, exact, and the matrix places the grid. Otherwise they are rounded offsets
// from the centre of the mesh's box. glTF is y-up: a point (x, y, z) with z up is stored as (x, z, -y). This is a
// rotation, so that viewers show the terrain upright and triangles keep their orientation.
//
// Colours are sRGB, as in images. PLY stores them as bytes; OBJ stores them after the coordinates as numbers from 0 to
// 1, with enough digits to restore the bytes. glTF requires linear vertex colours: GLB has COLOR_0 as normalized 16-bit
// integers, because 8 linear bits are too few for dark colours. Each GLB has a non-metallic material, because the
// default material is metallic, which is dark without a picture to reflect.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <ostream>
#include <stop_token>
#include <string_view>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/result.h"
#include "proto/gltf/gltf_types.h"

namespace terrace::proto {

// Selects the format by the extension of a file name, ignoring case. kInvalidArgument: unknown extension.
Result<MeshFileFormat> MeshFileFormatOf(std::string_view file_name);

struct MeshVertex {
  double x = 0, y = 0, z = 0;
};

// From columns and rows of a raster to the file's x and y, in GDAL's order: x = t[0] + column t[1] + row t[2],
// y = t[3] + column t[4] + row t[5].
using GridPlacement = std::array<double, 6>;

// Appends the whole file to `out`, which must be in binary mode. Precondition with `placement`: x and y of the
// vertices are columns and rows, and all coordinates are representable as 32-bit floats. Then a GLB stores them
// exactly, except for a sheared raster: a glTF node cannot express shear, so coordinates are rounded as without
// `placement`. kInvalidArgument: the mesh has no triangles, a coordinate is not finite, or the mesh exceeds the
// format's limits; nothing is written. kUnavailable: writing failed, for example because the disk is full. kCancelled:
// a stop was requested; part of the file may be written. Preconditions: every index is below vertices.size(); `colors`
// is empty or has one entry per vertex.
Result<void> WriteMesh(std::ostream& out, MeshFileFormat format, std::vector<MeshVertex> vertices,
                       const std::vector<std::array<std::uint32_t, 3>>& triangles, const std::vector<Rgb>& colors = {},
                       const std::optional<GridPlacement>& placement = std::nullopt, const std::stop_token& stop = {});

}  // namespace terrace::proto
