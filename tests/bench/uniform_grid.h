// A regular grid of samples as an approximation, the baseline of section 4.5 of the paper. It does not depend on
// heights.
#pragma once

#include <cstddef>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::bench {

// Nodes are at evenly spaced columns and rows, rounded to samples, including the borders. Every cell is divided along
// the diagonal from its larger column and smaller row. 2 <= columns <= width, 2 <= rows <= height.
tin::TinMesh UniformGrid(const tin::HeightField& field, int columns, int rows);

// The grid of nearly square cells whose number of nodes is nearest to `points`.
tin::TinMesh UniformGridOf(const tin::HeightField& field, std::size_t points);

}  // namespace terrace::bench
