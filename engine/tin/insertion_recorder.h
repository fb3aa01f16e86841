// Writes down a run of insertions as it goes: what a Refinement is made of.
#pragma once

#include <cstdint>
#include <vector>

#include "engine/tin/refinement.h"
#include "engine/tin/star.h"

namespace terrace::tin {

class InsertionRecorder {
 public:
  InsertionRecorder() : made_in_slot_{0, 1} { record_.removed.assign(2, Record::kNever); }

  // Goes on with a refinement whose mesh is in the triangulation, its triangles in the order of MeshOf.
  explicit InsertionRecorder(const Refinement& refinement);

  // The star is that of sample `inserted`, whose insertion mended `error_before`.
  void Append(SamplePosition inserted, float error_before, const Star& star);

  Refinement Make(int width, int height) const { return {width, height, inserted_, errors_before_, record_}; }

 private:
  using Record = InsertionRecord<std::uint32_t>;

  std::vector<SamplePosition> inserted_;
  std::vector<float> errors_before_;
  Record record_;
  std::vector<std::uint32_t> made_in_slot_;  // by slot: which triangle of the record is there now
};

}  // namespace terrace::tin
