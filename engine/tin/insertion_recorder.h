// Writes down a run of insertions as it goes: what a Refinement is made of.
//
// While the run goes on, all that is written is a log, from one end to the other. Which triangle was removed by which
// insertion is found out when a refinement is asked for: that jumps about, and beside the run it would push the mesh
// out of the cache.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/tin/mesh/spare_blocks.h"
#include "engine/tin/mesh/star.h"
#include "engine/tin/refinement.h"

namespace terrace::tin {

class InsertionRecorder {
 public:
  // Room is made for so many insertions. There may be more.
  explicit InsertionRecorder(std::size_t likely_insertions);

  // Goes on with a refinement whose mesh is in the triangulation, its triangles in the order of MeshOf.
  explicit InsertionRecorder(const Refinement& refinement);

  // The star is that of sample `inserted`, whose insertion mended `error_before`.
  void Append(SamplePosition inserted, float error_before, const Star& star);

  Refinement Make(int width, int height) const;

 private:
  using Word = std::uint32_t;

  template <typename Index>
  InsertionRecord<Index> Finish() const;

  LargeArray<SamplePosition> inserted_;
  LargeArray<float> errors_before_;

  // Before the log begins: the record, and by slot which of its triangles is there.
  InsertionRecord<std::uint32_t> begun_;
  std::vector<std::uint32_t> made_in_slot_;

  // By insertion: triangles made, with InsertionRecord::kOpen; the ring of vertices; the slots of the triangles
  // removed, two fewer than made, one fewer in an open star. The first triangles made are in these slots, the others in
  // new ones.
  LargeArray<Word> log_;
  std::size_t made_ = 0, most_made_ = 0;  // triangles, in all and by one insertion
  std::size_t corners_ = 0;               // of all rings
};

}  // namespace terrace::tin
