#include "engine/tin/mesh/spare_blocks.h"

#include <sys/mman.h>

#include <array>
#include <cstring>

#if defined(__SANITIZE_ADDRESS__)  // g++
#define TERRACE_HAS_ASAN
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)  // clang
#define TERRACE_HAS_ASAN
#endif
#if __has_feature(thread_sanitizer)
#define TERRACE_HAS_TSAN
#endif
#endif
#ifdef __SANITIZE_THREAD__
#define TERRACE_HAS_TSAN
#endif
#ifdef TERRACE_HAS_ASAN
#include <sanitizer/asan_interface.h>
#else
#define ASAN_POISON_MEMORY_REGION(address, bytes)
#define ASAN_UNPOISON_MEMORY_REGION(address, bytes)
#endif

namespace terrace::tin {
namespace {

// A block's size is stored in the cache line before it; the line after it is unused.
constexpr std::size_t kLine = 64;
constexpr std::size_t kPage = 4096;
constexpr std::size_t kMaxBlocks = 16;

std::size_t SizeOf(const void* block) {
  std::size_t size = 0;
  std::memcpy(&size, static_cast<const std::byte*>(block) - kLine, sizeof size);
  return size;
}

std::size_t MappedFor(std::size_t bytes) { return (bytes + 2 * kLine + kPage - 1) / kPage * kPage; }

// For a mapping, new or moved.
void* BlockIn(void* mapping, std::size_t bytes) {
  if (mapping == MAP_FAILED) throw std::bad_alloc();
  auto* const line = static_cast<std::byte*>(mapping);
  std::memcpy(line, &bytes, sizeof bytes);
  ASAN_POISON_MEMORY_REGION(line + kLine + bytes, MappedFor(bytes) - kLine - bytes);
  return line + kLine;
}

void* NewBlock(std::size_t bytes) {
  constexpr int kFlags = MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE;
  return BlockIn(::mmap(nullptr, MappedFor(bytes), PROT_READ | PROT_WRITE, kFlags, -1, 0), bytes);
}

void DeleteBlock(void* block) noexcept {
  const std::size_t mapped = MappedFor(SizeOf(block));
  void* const mapping = static_cast<std::byte*>(block) - kLine;
  ASAN_UNPOISON_MEMORY_REGION(mapping, mapped);
  ::munmap(mapping, mapped);
}

void* MoveBlock(void* block, std::size_t bytes) {
#ifdef TERRACE_HAS_TSAN
  // ThreadSanitizer tracks mmap and munmap, but not that mremap frees addresses for other threads.
  void* const moved = NewBlock(bytes);
  std::memcpy(moved, block, SizeOf(block));
  DeleteBlock(block);
  return moved;
#else
  const std::size_t mapped = MappedFor(SizeOf(block));
  void* const mapping = static_cast<std::byte*>(block) - kLine;
  ASAN_UNPOISON_MEMORY_REGION(mapping, mapped);
  return BlockIn(::mremap(mapping, mapped, MappedFor(bytes), MREMAP_MAYMOVE), bytes);
#endif
}

// Whether this thread's store was destroyed: arrays that outlive it are freed directly.
thread_local bool is_closed = false;

// Oldest first.
class Store {
 public:
  ~Store() {
    Clear();
    is_closed = true;
  }

  // The smallest block that is large enough and not twice as large; nullptr if there is none.
  void* Take(std::size_t bytes) {
    std::size_t best = count_;
    for (std::size_t i = 0; i < count_; ++i) {
      const std::size_t size = SizeOf(blocks_[i]);
      if (size >= bytes && size / 2 <= bytes && (best == count_ || size < SizeOf(blocks_[best]))) best = i;
    }
    return best == count_ ? nullptr : Remove(best);
  }
  void Put(void* block) noexcept {
    const std::size_t size = SizeOf(block);
    if (size > kMaxSpareBytes) return DeleteBlock(block);
    while (count_ == kMaxBlocks || bytes_ + size > kMaxSpareBytes) DeleteBlock(Remove(0));
    blocks_[count_++] = block;
    bytes_ += size;
  }
  void Clear() noexcept {
    while (count_ > 0) DeleteBlock(Remove(count_ - 1));
  }
  std::size_t bytes() const { return bytes_; }

 private:
  void* Remove(std::size_t i) noexcept {
    void* const block = blocks_[i];
    bytes_ -= SizeOf(block);
    for (--count_; i < count_; ++i) blocks_[i] = blocks_[i + 1];
    return block;
  }

  std::array<void*, kMaxBlocks> blocks_{};
  std::size_t count_ = 0, bytes_ = 0;
};

thread_local Store store;

}  // namespace

void* TakeBlock(std::size_t bytes) {
  void* const spare = is_closed ? nullptr : store.Take(bytes);
  return spare != nullptr ? spare : NewBlock(bytes);
}

void* GrowBlock(void* block, std::size_t used, std::size_t bytes) {
  void* const spare = is_closed ? nullptr : store.Take(bytes);
  if (spare == nullptr) return MoveBlock(block, bytes);
  std::memcpy(spare, block, used);
  GiveBlock(block);
  return spare;
}

void GiveBlock(void* block) noexcept { is_closed ? DeleteBlock(block) : store.Put(block); }

void ReleaseBlock(void* block) noexcept { DeleteBlock(block); }

std::size_t SpareBytes() { return is_closed ? 0 : store.bytes(); }

void ReleaseSpareBlocks() {
  if (!is_closed) store.Clear();
}

}  // namespace terrace::tin
