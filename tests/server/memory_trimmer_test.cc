#include "server/memory_trimmer.h"

#include <gtest/gtest.h>

#include <chrono>
#include <cstddef>
#include <cstring>
#include <ctime>
#include <memory>
#include <thread>
#include <utility>
#include <vector>

#include "tests/support/resident_memory.h"

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

// 64 MiB in blocks that are too small to be mapped one by one. Every other block is freed again.
struct Holes {
  Holes() {
    std::vector<std::unique_ptr<char[]>> freed;
    for (int i = 0; i < 1024; ++i) {
      auto piece = std::make_unique<char[]>(kPiece);
      std::memset(piece.get(), 1, kPiece);
      (i % 2 == 0 ? freed : kept).push_back(std::move(piece));
    }
  }
  static constexpr std::size_t kPiece = 64 << 10;
  std::vector<std::unique_ptr<char[]>> kept;
};

// Uses enough processor time for a trim.
void Compute() {
  const std::clock_t begun = std::clock();
  while (std::clock() - begun < CLOCKS_PER_SEC / 100) {
  }
}

TEST(MemoryTrimmer, GivesHolesBack) {
  if (test_support::kSanitized) GTEST_SKIP() << "sanitizers have an allocator of their own";
  const Holes holes;
  const long before = test_support::ResidentKib();
  const MemoryTrimmer trimmer(10ms);
  for (int i = 0; i < 300 && test_support::ResidentKib() > before - (24 << 10); ++i) {
    Compute();
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_LE(test_support::ResidentKib(), before - (24 << 10));
}

TEST(MemoryTrimmer, EndsAtOnce) {
  const MemoryTrimmer trimmer(1h);  // otherwise this test does not end
}

}  // namespace
}  // namespace terrace::server
