#include "engine/tin/insertion_recorder.h"

#include <algorithm>
#include <cstring>
#include <limits>

namespace terrace::tin {
namespace {

// Words of a typical insertion: six triangles, a ring of six vertices, four slots.
constexpr std::size_t kLikelyWords = 11;

// The number copied in one step: enough for most insertions.
constexpr std::size_t kFewest = 8;
static_assert(kFewest <= Ring::kPadding);

// Usually a single step; std::copy would be a function call.
void CopyFew(const std::uint32_t* from, std::size_t count, std::uint32_t* to) {
  for (std::size_t i = 0; i < count; i += kFewest) std::memcpy(to + i, from + i, kFewest * sizeof *to);
}

// The position of the smallest value, without branches, which would be mispredicted.
std::size_t SmallestOf(const std::uint32_t* values, std::size_t count) {
  std::uint64_t smallest = std::numeric_limits<std::uint64_t>::max();
  for (std::size_t i = 0; i < count; ++i) smallest = std::min(smallest, std::uint64_t{values[i]} << 32 | i);
  return static_cast<std::uint32_t>(smallest);
}

}  // namespace

InsertionRecorder::InsertionRecorder(std::size_t likely_insertions) : made_in_slot_{0, 1} {
  begun_.removed.assign(2, InsertionRecord::kNever);
  made_ = begun_.removed.size();
  inserted_.reserve(likely_insertions);
  errors_before_.reserve(likely_insertions);
  log_.reserve(kLikelyWords * likely_insertions);
}

InsertionRecorder::InsertionRecorder(const Refinement& refinement) : begun_(refinement.record()) {
  inserted_.Append(refinement.inserted());
  errors_before_.Append(refinement.errors_before());
  for (std::uint32_t made = 0; made < begun_.removed.size(); ++made) {
    if (begun_.removed[made] == InsertionRecord::kNever) made_in_slot_.push_back(made);
  }
  made_ = begun_.removed.size();
  corners_ = begun_.rings.size();
}

void InsertionRecorder::Append(SamplePosition inserted, float error_before, const Star& star) {
  inserted_.push_back(inserted);
  errors_before_.push_back(error_before);
  max_made_ = std::max(max_made_, star.count);
  const std::size_t corners = star.count + (star.is_closed ? 0 : 1), words = 1 + corners + star.removed_count;
  made_ += star.count;
  corners_ += corners;
  if (log_.capacity() - log_.size() < words + kFewest) log_.reserve(2 * (log_.capacity() + words + kFewest));
  log_.GrowBy(words);
  Word* word = log_.end() - words;
  *word++ = static_cast<Word>(star.count) | (star.is_closed ? 0 : InsertionRecord::kOpen);
  CopyFew(star.ring.ids.data(), corners, word);
  CopyFew(star.triangles.data(), star.removed_count, word + corners);
}

std::optional<Refinement> InsertionRecorder::Make(int width, int height) const {
  if (4 + inserted_.size() > Refinement::kMaxVertices || max_made_ > Refinement::kMaxStar) return std::nullopt;
  return Refinement(width, height, {inserted_.begin(), inserted_.end()}, {errors_before_.begin(), errors_before_.end()},
                    Finish());
}

InsertionRecord InsertionRecorder::Finish() const {
  using Index = InsertionRecord::Index;
  InsertionRecord record = begun_;
  std::size_t insertion = record.sizes.size(), made = record.removed.size(), corners = record.rings.size();
  record.sizes.resize(inserted_.size());
  record.rings.resize(corners_);
  record.removed.resize(made_, InsertionRecord::kNever);
  std::vector<std::uint32_t> made_in_slot = made_in_slot_;
  std::size_t slots = made_in_slot.size();
  made_in_slot.resize(slots + 2 * (inserted_.size() - insertion));
  for (const Word* word = log_.begin(); word != log_.end(); ++insertion) {
    record.sizes[insertion] = static_cast<Index>(*word);
    const bool is_open = (*word & InsertionRecord::kOpen) != 0;
    const std::size_t count = *word++ & Refinement::kMaxStar, removed = count - (is_open ? 1 : 2);
    const Word *const ring = word, *const ring_end = ring + count + (is_open ? 1 : 0);
    // A closed ring may begin anywhere. Its smallest id comes first, so that the record is a function of the
    // insertions.
    const std::size_t turn = is_open ? 0 : SmallestOf(ring, count);
    const auto next = std::copy(ring + turn, ring_end, record.rings.begin() + static_cast<std::ptrdiff_t>(corners));
    std::copy(ring, ring + turn, next);
    corners += static_cast<std::size_t>(ring_end - ring);
    word = ring_end;
    for (std::size_t i = 0; i < removed; ++i) record.removed[made_in_slot[word[i]]] = static_cast<Index>(insertion);
    // Triangle i of the star is triangle i - turn, modulo count, of the record.
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t slot = i < removed ? word[i] : slots++;
      made_in_slot[slot] = static_cast<std::uint32_t>(made + i + (i >= turn ? 0 : count) - turn);
    }
    made += count;
    word += removed;
  }
  return record;
}

}  // namespace terrace::tin
