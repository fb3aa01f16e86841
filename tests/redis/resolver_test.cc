#include "redis/resolver.h"

#include <gtest/gtest.h>
#include <netinet/in.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <future>
#include <memory>
#include <thread>

namespace terrace::redis {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

auto In(milliseconds time) { return std::chrono::steady_clock::now() + time; }

HostAddress Address(std::uint32_t number) {
  sockaddr_in in{};
  in.sin_family = AF_INET;
  in.sin_addr.s_addr = htonl(number);
  return {reinterpret_cast<const char*>(&in), sizeof in};
}

std::uint32_t NumberOf(const Result<std::vector<HostAddress>>& found) {
  if (!found || found->size() != 1) return 0;
  sockaddr_in in{};
  std::memcpy(&in, found->front().data(), std::min(sizeof in, found->front().size()));
  return ntohl(in.sin_addr.s_addr);
}

// A look-up that waits until it is told what to answer.
struct SlowSystem {
  struct State {
    std::atomic<int> asked{0};
    std::promise<Result<std::vector<HostAddress>>> first, second;
  };
  std::shared_ptr<State> state = std::make_shared<State>();

  Resolver::LookUp LookUp() {
    return [state = state](const std::string&, std::uint16_t) {
      return (state->asked++ == 0 ? state->first : state->second).get_future().get();
    };
  }
};

TEST(RedisResolver, ALookUpThatHangsEndsAtTheDeadline) {
  const SlowSystem system;
  Resolver resolver(SlowSystem(system).LookUp());
  for (int i = 0; i < 3; ++i) {
    const auto found = resolver.Resolve("redis.example", 6379, In(milliseconds(20)));
    ASSERT_FALSE(found);
    EXPECT_EQ(found.error().code, ErrorCode::kUnavailable);
    EXPECT_NE(found.error().message.find("not known in time"), std::string::npos) << found.error().message;
  }
  EXPECT_LE(system.state->asked, 1) << "one look-up at a time, however many wait";
  // Of a second look-up, if the late answer has arrived before the next call.
  system.state->second.set_value(std::vector{Address(7)});
  system.state->first.set_value(std::vector{Address(7)});
  EXPECT_EQ(NumberOf(resolver.Resolve("redis.example", 6379, In(seconds(30)))), 7U)
      << "the answer that came late counts";
}

TEST(RedisResolver, TheLastAddressesStandInForAnAnswerThatIsLate) {
  const SlowSystem system;
  Resolver resolver(SlowSystem(system).LookUp());
  system.state->first.set_value(std::vector{Address(7)});
  EXPECT_EQ(NumberOf(resolver.Resolve("redis.example", 6379, In(seconds(30)))), 7U);
  EXPECT_EQ(NumberOf(resolver.Resolve("redis.example", 6379, In(milliseconds(20)))), 7U);
  system.state->second.set_value(MakeError(ErrorCode::kUnavailable, "try again"));
}

TEST(RedisResolver, AFailureKeepsTheLastAddressesButNotIfThereIsNoSuchHost) {
  for (const ErrorCode code : {ErrorCode::kUnavailable, ErrorCode::kNotFound}) {
    const SlowSystem system;
    Resolver resolver(SlowSystem(system).LookUp());
    system.state->first.set_value(std::vector{Address(7)});
    system.state->second.set_value(MakeError(code, "the answer"));
    EXPECT_EQ(NumberOf(resolver.Resolve("redis.example", 6379, In(seconds(30)))), 7U);
    const auto again = resolver.Resolve("redis.example", 6379, In(seconds(30)));
    EXPECT_EQ(NumberOf(again), code == ErrorCode::kNotFound ? 0U : 7U);
    if (!again) {
      EXPECT_NE(again.error().message.find("the answer"), std::string::npos);
    }
  }
}

TEST(RedisResolver, NumbersAreNotLookedUp) {
  const SlowSystem system;
  Resolver resolver(SlowSystem(system).LookUp());
  EXPECT_EQ(NumberOf(resolver.Resolve("127.0.0.1", 6379, In(milliseconds(0)))), 0x7f000001U);
  EXPECT_TRUE(resolver.Resolve("::1", 6379, In(milliseconds(0))));
  EXPECT_EQ(system.state->asked, 0);
}

TEST(RedisResolver, TheSystemKnowsLocalhost) {
  EXPECT_TRUE(Resolver::OfSystem().Resolve("localhost", 6379, In(seconds(30))));
}

}  // namespace
}  // namespace terrace::redis
