// The triangles that stand after so many insertions of a record: what a replay draws (refinement.h).
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/mesh/insertion_record.h"

namespace terrace::tin {

// In the order in which they were made; corners are vertices, the four of the field first. The record must be sound
// and have at least `insertions`.
std::vector<std::array<std::uint32_t, 3>> StandingTriangles(const InsertionRecord<std::uint16_t>& record,
                                                            std::size_t insertions);
std::vector<std::array<std::uint32_t, 3>> StandingTriangles(const InsertionRecord<std::uint32_t>& record,
                                                            std::size_t insertions);

}  // namespace terrace::tin
