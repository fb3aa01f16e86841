#include "server/access/rate_limiter.h"

#include <gtest/gtest.h>

#include <string>

namespace terrace::server {
namespace {

using namespace std::chrono_literals;

class RateLimiterTest : public testing::Test {
 protected:
  // Number of `tries` requests that pass without waiting.
  int Passing(std::string_view client, RateLimiter::Rate rate, int tries) {
    int passed = 0;
    for (int i = 0; i < tries; ++i) passed += limiter_.Take(client, rate, now_, 0ms).granted;
    return passed;
  }

  RateLimiter limiter_;
  RateLimiter::Clock::time_point now_ = RateLimiter::Clock::now();
};

TEST_F(RateLimiterTest, LetsABurstPassAndThenTheRate) {
  const RateLimiter::Rate rate{10, 5};
  EXPECT_EQ(Passing("a", rate, 20), 5);
  now_ += 300ms;
  EXPECT_EQ(Passing("a", rate, 20), 3);
  now_ += 1h;
  EXPECT_EQ(Passing("a", rate, 20), 5) << "no more than the burst is saved";
}

TEST_F(RateLimiterTest, SaysHowLongToWait) {
  const RateLimiter::Rate rate{0.5, 1};
  const auto take = [&] { return limiter_.Take("a", rate, now_, 0ms); };
  EXPECT_TRUE(take().granted);
  EXPECT_FALSE(take().granted);
  EXPECT_EQ(take().wait, 2000ms);
  now_ += 1500ms;
  EXPECT_EQ(take().wait, 500ms);
  now_ += 501ms;
  EXPECT_TRUE(take().granted);
}

TEST_F(RateLimiterTest, WhoCanWaitIsGivenATurn) {
  const RateLimiter::Rate rate{10, 2};
  const auto take = [&] { return limiter_.Take("a", rate, now_, 1s); };
  for (int i = 0; i < 2; ++i) EXPECT_EQ(take().wait, 0ms);
  for (int i = 1; i <= 10; ++i) {
    const RateLimiter::Turn turn = take();
    EXPECT_TRUE(turn.granted) << i;
    EXPECT_EQ(turn.wait, i * 100ms) << "one after the other";
  }
  const RateLimiter::Turn refused = take();
  EXPECT_FALSE(refused.granted);
  EXPECT_EQ(refused.wait, 100ms) << "then one more would be given a turn";
  now_ += 100ms;
  EXPECT_TRUE(take().granted) << "a refusal has taken nothing";
}

TEST_F(RateLimiterTest, CountsEachClientByItself) {
  const RateLimiter::Rate rate{1, 2};
  EXPECT_EQ(Passing("a", rate, 5), 2);
  EXPECT_EQ(Passing("b", rate, 5), 2);
}

TEST_F(RateLimiterTest, WithoutARateEverythingPasses) { EXPECT_EQ(Passing("a", {0, 0}, 1000), 1000); }

TEST_F(RateLimiterTest, LetsAtLeastOnePass) { EXPECT_EQ(Passing("a", {1, 0.1}, 3), 1); }

TEST_F(RateLimiterTest, DoesNotForgetTheBusyForTheQuiet) {
  const RateLimiter::Rate rate{1, 100};
  EXPECT_EQ(Passing("busy", rate, 100), 100);
  for (int i = 0; i < 300'000; ++i) limiter_.Take(std::to_string(i), rate, now_, 0ms);
  EXPECT_EQ(Passing("busy", rate, 10), 0) << "more clients than there are places";
}

}  // namespace
}  // namespace terrace::server
