// The triangles that exist after a number of insertions of a record (refinement.h).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/mesh/insertion_record.h"

namespace terrace::tin {

// Triangles in the order in which they were made. Their corners are vertex indices; 0 to 3 are the corners of the
// field. Precondition: the record is sound and has at least `insertions` insertions.
std::vector<std::array<std::uint32_t, 3>> LiveTriangles(const InsertionRecord& record, std::size_t insertions);

}  // namespace terrace::tin
