// The record of a run of insertions (refinement.h).
#pragma once

#include <cstdint>
#include <vector>

namespace terrace::tin {

struct InsertionRecord {
  using Index = std::uint16_t;  // a vertex, an insertion or the size of a ring
  static constexpr Index kNever = 0xFFFF;
  static constexpr Index kOpen = 0x8000;

  // By insertion: the number n of triangles made. The ring has n vertices. If the inserted sample lies on the border of
  // the field, the ring is open and has n + 1 vertices, and kOpen is added.
  std::vector<Index> sizes;
  // The vertices of all rings, insertion after insertion. Vertices 0 to 3 are the corners of the field, 4 + i is the
  // sample of insertion i.
  std::vector<Index> rings;
  // By triangle: the insertion that removed it, or kNever. Triangles are in the order in which they were made; the
  // first two are those that the field begins with.
  std::vector<Index> removed;

  friend bool operator==(const InsertionRecord&, const InsertionRecord&) = default;
};

}  // namespace terrace::tin
