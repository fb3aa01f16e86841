// Records a run of insertions, from which a Refinement is made.
//
// During the run, entries are only appended to a log. Make finds out which insertion removed which triangle. That takes
// random access to the record, which would evict the mesh from the cache during the run.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine/tin/mesh/spare_blocks.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/refinement.h"

namespace terrace::tin {

class InsertionRecorder {
 public:
  // Reserves memory for this number of insertions. More are possible.
  explicit InsertionRecorder(std::size_t likely_insertions);

  // Continues a refinement. Precondition: the triangulation holds its mesh, with the triangles in the order of MeshOf.
  explicit InsertionRecorder(const Refinement& refinement);

  // `star`: of the sample `inserted`. `error_before`: the error before its insertion.
  void Append(SamplePosition inserted, float error_before, const Star& star);

  // Null if the run is larger than a refinement may be.
  std::optional<Refinement> Make(int width, int height) const;

 private:
  using Word = std::uint32_t;

  InsertionRecord Finish() const;

  LargeArray<SamplePosition> inserted_;
  LargeArray<float> errors_before_;

  // The record before the log, and for each slot the index of the triangle in it.
  InsertionRecord begun_;
  std::vector<std::uint32_t> made_in_slot_;

  // For each insertion: the number of triangles made, with InsertionRecord::kOpen; the ring of vertices; the slots of
  // the triangles removed. An insertion removes two triangles fewer than it makes, or one fewer in an open star. The
  // first triangles made take the slots of the removed ones, the others new slots.
  LargeArray<Word> log_;
  std::size_t made_ = 0, max_made_ = 0;  // triangles, in all and by one insertion of the log
  std::size_t corners_ = 0;              // of all rings
};

}  // namespace terrace::tin
