#include "server/memory_trimmer.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <cstring>
#include <ctime>
#include <memory>
#include <thread>
#include <vector>

#include "tests/server/resident_memory.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

// 64 MiB in pieces that the allocator does not map one by one; what lies between them lives on.
struct Holes {
  Holes() {
    for (int i = 0; i < 1024; ++i) {
      freed.push_back(std::make_unique<char[]>(kPiece));
      std::memset(freed.back().get(), 1, kPiece);
      kept.push_back(std::make_unique<char[]>(64));
    }
    freed.clear();
  }
  static constexpr std::size_t kPiece = 64 << 10;
  std::vector<std::unique_ptr<char[]>> freed, kept;
};

// So much that a trim is worth it.
void Compute() {
  const std::clock_t begun = std::clock();
  while (std::clock() - begun < CLOCKS_PER_SEC / 100) {
  }
}

TEST(MemoryTrimmer, GivesHolesBack) {
  if (kSanitized) GTEST_SKIP() << "sanitizers have an allocator of their own";
  const Holes holes;
  const long before = ResidentKib();
  const MemoryTrimmer trimmer(10ms);
  for (int i = 0; i < 300 && ResidentKib() > before - (48 << 10); ++i) {
    Compute();
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_LE(ResidentKib(), before - (48 << 10));
}

TEST(MemoryTrimmer, EndsAtOnce) {
  const MemoryTrimmer trimmer(10ms);  // or this test does not end
}

}  // namespace
}  // namespace terrace::server
