#include "engine/common/content_hash.h"

#include <xxhash.h>

#include <new>

namespace terrace::dem {

void ContentHasher::Free::operator()(XXH3_state_s* state) const { XXH3_freeState(state); }

ContentHasher::ContentHasher() : state_(XXH3_createState()) {
  if (state_ == nullptr) throw std::bad_alloc();
  XXH3_128bits_reset(state_.get());
}

void ContentHasher::AddBytes(const void* bytes, std::size_t size) { XXH3_128bits_update(state_.get(), bytes, size); }

void ContentHasher::AddText(std::string_view text) {
  Add(std::uint64_t{text.size()});
  AddBytes(text.data(), text.size());
}

ContentHash ContentHasher::Hash() const {
  const XXH128_hash_t hash = XXH3_128bits_digest(state_.get());
  return {hash.high64, hash.low64};
}

}  // namespace terrace::dem
