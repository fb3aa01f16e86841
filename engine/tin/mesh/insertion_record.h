// The record of a run of insertions (refinement.h).
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

namespace terrace::tin {

// Index: an integer that holds vertices, insertions and sizes of rings.
template <typename Index>
struct InsertionRecord {
  static constexpr Index kNever = static_cast<Index>(-1);
  static constexpr Index kOpen = static_cast<Index>(Index{1} << (8 * sizeof(Index) - 1));

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

// The same record with another type of index. Precondition: all values fit.
template <typename To, typename From>
InsertionRecord<To> ConvertTo(const InsertionRecord<From>& record) {
  using Source = InsertionRecord<From>;
  using Target = InsertionRecord<To>;
  Target converted;
  converted.sizes.reserve(record.sizes.size());
  for (const From size : record.sizes) {
    const auto triangles = static_cast<To>(size & static_cast<From>(~Source::kOpen));
    converted.sizes.push_back((size & Source::kOpen) != 0 ? static_cast<To>(triangles | Target::kOpen) : triangles);
  }
  converted.rings.assign(record.rings.begin(), record.rings.end());
  converted.removed.resize(record.removed.size());
  std::transform(record.removed.begin(), record.removed.end(), converted.removed.begin(),
                 [](From by) { return by == Source::kNever ? Target::kNever : static_cast<To>(by); });
  return converted;
}

}  // namespace terrace::tin
