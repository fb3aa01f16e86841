// Requests in which the nth allocation fails, for every n. A separate program, because it replaces operator new.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <set>

#include "tests/server/server_fixture.h"

namespace {

std::atomic<long> left_until_failure{-1};  // below 0: none fails
thread_local bool is_test_thread = false;  // allocations of this thread never fail

void* Allocate(std::size_t size, std::size_t alignment) {
  if (!is_test_thread && left_until_failure.load(std::memory_order_relaxed) >= 0 &&
      left_until_failure.fetch_sub(1) == 0) {
    return nullptr;
  }
  return std::aligned_alloc(alignment, (size + alignment) / alignment * alignment);
}

void* AllocateOrThrow(std::size_t size, std::size_t alignment) {
  void* const memory = Allocate(size, alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t size) { return AllocateOrThrow(size, __STDCPP_DEFAULT_NEW_ALIGNMENT__); }
void* operator new(std::size_t size, std::align_val_t to) {
  return AllocateOrThrow(size, static_cast<std::size_t>(to));
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept {
  return Allocate(size, __STDCPP_DEFAULT_NEW_ALIGNMENT__);
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }

namespace terrace::server {
namespace {

class FailingAllocations : public ServerFixture {
 protected:
  void SetUp() override { is_test_thread = true; }

  // Fails the nth allocation of the server while it answers `request`, for every n up to the number of allocations.
  void TryAll(const std::string& request, std::set<int> allowed, ServerOptions options = {}) {
    Start(std::move(options));
    RawClient warm(port());
    warm.Send(request);
    ASSERT_TRUE(warm.Read());
    int n = 0, refused = 0, closed = 0;
    for (bool failed = true; failed; ++n) {
      ASSERT_LT(n, 5000);
      left_until_failure = n;
      std::optional<Reply> reply;
      {
        RawClient client(port());
        if (client.Send(request)) reply = client.Read();
      }
      failed = left_until_failure.exchange(-1) < 0;
      EXPECT_TRUE(!reply || allowed.contains(reply->status)) << "n = " << n << ": " << reply->status;
      refused += reply && reply->status == 503;
      closed += !reply;
      const Reply next = Fetch(port(), "/livez");
      ASSERT_EQ(next.status, 200) << "n = " << n;
    }
    RecordProperty("allocations", n - 1);
    RecordProperty("refused", refused);
    RecordProperty("closed", closed);
    EXPECT_GT(n, 5);
  }
};

TEST_F(FailingAllocations, CostOneAnswerFromTheCacheAtMost) { TryAll(Get("/maui/0/0/0.terrain"), {200, 503}); }

TEST_F(FailingAllocations, CostOneBuildAtMost) {
  ServerOptions options;
  options.config.cache_bytes = 0;
  TryAll(Get("/maui/1/1/1.terrain?error=1000"), {200, 503}, options);
}

TEST_F(FailingAllocations, CostOneDocumentAtMost) { TryAll(Get("/maui/layer.json"), {200, 503}); }

TEST_F(FailingAllocations, CostOneRefusalAtMost) { TryAll(Get("/maui/9/0/0.terrain"), {404, 503}); }

}  // namespace
}  // namespace terrace::server
