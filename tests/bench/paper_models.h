// The paper's elevation models, and the error of a greedy mesh over its number of vertices.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh/height_field.h"
#include "tests/bench/figure.h"
#include "tests/bench/rasters.h"

namespace terrace::bench {

inline constexpr const char* kDelaunayName = "Delaunay";
inline constexpr const char* kDataDependentName = "data-dependent";

// Dies if the file is missing.
tin::HeightField Model(const std::string& file, const Window& window = {});

// 1, 2, 5, 10, ... times 100, up to a third of the samples: the axis of the curves.
std::vector<std::size_t> VertexCounts(const tin::HeightField& field);

// RMS at these numbers of vertices.
Series GreedyCurve(const tin::HeightField& field, const std::string& name, const tin::GreedyOptions& options);

}  // namespace terrace::bench
