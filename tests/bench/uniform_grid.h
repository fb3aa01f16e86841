// A regular grid of samples as an approximation: the baseline of section 4.5 of the paper. It looks at no height at
// all.
#pragma once

#include <cstddef>

#include "engine/tin/mesh/height_field.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::bench {

// Nodes at evenly spaced columns and rows, rounded to samples, the borders among them; every cell is cut along the
// diagonal from its larger column and smaller row. 2 <= columns <= width, 2 <= rows <= height.
tin::TinMesh UniformGrid(const tin::HeightField& field, int columns, int rows);

// The grid of nearly square cells whose number of nodes is nearest to `points`.
tin::TinMesh UniformGridOf(const tin::HeightField& field, std::size_t points);

}  // namespace terrace::bench
