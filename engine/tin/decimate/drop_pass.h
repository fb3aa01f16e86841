// The drop pass: takes back those vertices of a greedy mesh that its error bound does not need.
//
// Greedy insertion never removes a vertex, though later ones often make an earlier one idle. Garland and Heckbert,
// "Fast Triangular Approximation of Terrains and Height Fields" (1997), section 5, propose a hybrid of refinement and
// decimation; this is one. Inner vertices are visited from the last inserted to the first, one block of 256 x 256
// samples after the other. One is dropped if its hole can be filled by a fan of triangles from one of its neighbours
// with every sample of the hole within the bound. Fans are tried in the order of their error at the dropped vertex,
// smallest first, then of their place in the ring (vertex_rings.h); the first that fits is taken. Neighbours of a
// dropped vertex are visited again in the next sweep, until a sweep drops nothing.
//
// Vertices on the border stay, and with them the border: fields that share one still match along it. The result is not
// Delaunay, and no prefix of a finer one: it belongs to one threshold.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <stop_token>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

struct DropOptions {
  double max_error = 0;   // metres, >= 0: no sample of a new triangle is further off
  Curvature curvature{};  // a new triangle's sagitta counts into the error of its samples

  // Quantized positions, 0 to 32767, by column and by row. New triangles turn counter-clockwise
  // there too: rounding can turn a sliver over. Empty, both: not tested.
  std::span<const std::uint16_t> quantized_columns{};
  std::span<const std::uint16_t> quantized_rows{};
};

// `mesh` is a triangulation of `field` as TinMesh promises, by whatever criterion. The vertices that stay keep their
// order. MeasureError of the result is at most the larger of max_error and that of `mesh`, up to its rounding. The
// result does not depend on the order of the triangles of `mesh` or of their corners. Nothing when stopped. Safe to
// call from many threads at once.
std::optional<TinMesh> DropVertices(const HeightField& field, const TinMesh& mesh, const DropOptions& options,
                                    const std::stop_token& stop = {});

}  // namespace terrace::tin
