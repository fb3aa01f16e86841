#include "engine/tin/insertion_recorder.h"

#include <algorithm>

namespace terrace::tin {

InsertionRecorder::InsertionRecorder(const Refinement& refinement)
    : inserted_(refinement.inserted()), errors_before_(refinement.errors_before()), record_(refinement.WideRecord()) {
  for (std::uint32_t made = 0; made < record_.removed.size(); ++made) {
    if (record_.removed[made] == Record::kNever) made_in_slot_.push_back(made);
  }
}

void InsertionRecorder::Append(SamplePosition inserted, float error_before, const Star& star) {
  const auto insertion = static_cast<std::uint32_t>(inserted_.size());
  inserted_.push_back(inserted);
  errors_before_.push_back(error_before);
  for (std::size_t i = 0; i < star.removed_count; ++i) record_.removed[made_in_slot_[star.removed[i]]] = insertion;
  const auto count = static_cast<std::uint32_t>(star.count);
  record_.sizes.push_back(star.is_closed ? count : count | Record::kOpen);
  // A closed ring may begin anywhere. Its smallest id comes first, so that the record is a function of the insertions.
  const auto first = star.ring.ids.begin(), last = first + count + (star.is_closed ? 0 : 1);
  const auto begin = star.is_closed ? std::min_element(first, last) : first;
  record_.rings.insert(record_.rings.end(), begin, last);
  record_.rings.insert(record_.rings.end(), first, begin);
  made_in_slot_.resize(made_in_slot_.size() + count - star.removed_count);
  std::size_t triangle = static_cast<std::size_t>(begin - first);
  for (std::size_t i = 0; i < count; ++i) {
    made_in_slot_[star.triangles[triangle]] = static_cast<std::uint32_t>(record_.removed.size());
    record_.removed.push_back(Record::kNever);
    triangle = triangle + 1 < count ? triangle + 1 : 0;
  }
}

}  // namespace terrace::tin
