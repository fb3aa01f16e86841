// The criterion by which greedy insertion chooses the triangles around a vertex.
#pragma once

#include <cstdint>

namespace terrace::tin {

enum class Criterion : std::uint8_t {
  kDelaunay,
  kDataDependent,  // section 3.4 of Garland and Heckbert (1997): fewer vertices to the same error, thinner triangles,
                   // more time
};

}  // namespace terrace::tin
