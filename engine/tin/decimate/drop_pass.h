// The drop pass: removes the vertices of a greedy mesh that its error bound does not need.
//
// Greedy insertion never removes a vertex, though later insertions often make an earlier one redundant. Garland and
// Heckbert, "Fast Triangular Approximation of Terrains and Height Fields" (1997), section 5, propose a hybrid of
// refinement and decimation; this is one. Inner vertices are visited from the last inserted to the first, one block of
// 256 x 256 samples after the other. A vertex is dropped if the polygon that it leaves can be filled by a fan of
// triangles around one of its neighbours that keeps every sample of the polygon within the bound. Fans are tried in the
// order of their error at the dropped vertex, smallest first, then of their position in the ring (vertex_rings.h); the
// first fan within the bound is taken. Neighbours of a dropped vertex are visited again in the next sweep, until a
// sweep drops nothing.
//
// Border vertices stay: fields that share a border still match along it. The result is neither Delaunay nor a prefix of
// a finer mesh: it holds for one error bound.
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
  double max_error = 0;                  // metres, >= 0: no sample of a new triangle is further off
  const SampleLimits* limits = nullptr;  // with max_error as the run's error; null: none. Forced vertices stay
  Curvature curvature{};                 // a new triangle's sagitta is added to the error of its samples

  // Quantized positions, 0 to 32767, by column and by row. New triangles must be counter-clockwise in these positions
  // too, because rounding can flip a sliver. Both empty: not tested.
  std::span<const std::uint16_t> quantized_columns{};
  std::span<const std::uint16_t> quantized_rows{};
};

// `mesh` is a triangulation of `field` as TinMesh describes, by any criterion. Remaining vertices keep their order.
// MeasureError of the result is at most the larger of max_error and that of `mesh`, up to rounding. The result does not
// depend on the order of the triangles of `mesh` or of their corners. Returns nothing if stopped. Safe to call from
// many threads at once.
std::optional<TinMesh> DropVertices(const HeightField& field, const TinMesh& mesh, const DropOptions& options,
                                    const std::stop_token& stop = {});

}  // namespace terrace::tin
