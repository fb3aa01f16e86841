// Arrays as EXT_meshopt_compression stores them (meshoptimizer's codecs: version 0 for vertices, 1 for indices).
// Deterministic, thread-safe.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/mesh/vertex_order.h"

namespace terrace::proto {

// Numbers the vertices in an order that suits the index codec: triangles next to each other share vertices, and
// vertices stand in the order of their first use. Precondition: every vertex is used.
VertexOrder OrderForMeshopt(const std::vector<std::array<std::uint32_t, 3>>& triangles, std::size_t vertex_count);

// Mode ATTRIBUTES: `count` records of `stride` bytes, a multiple of 4 up to 256.
std::string EncodeMeshoptVertices(std::string_view records, std::size_t count, std::size_t stride);

// Mode TRIANGLES. Decodes to the same triangles in the same order. A triangle may begin at another corner.
std::string EncodeMeshoptTriangles(const std::vector<std::array<std::uint32_t, 3>>& triangles,
                                   std::size_t vertex_count);

}  // namespace terrace::proto
