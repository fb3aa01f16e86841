// The criterion by which the vertices of a mesh are joined.
#pragma once

#include <cstdint>

namespace terrace::tin {

// How the triangles around an inserted vertex are joined.
enum class Criterion : std::uint8_t {
  kDelaunay,
  kDataDependent,  // section 3.4 of the paper: fewer vertices to the same error, thinner triangles, more time
};

}  // namespace terrace::tin
