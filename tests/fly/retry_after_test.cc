#include "fly/http/retry_after.h"

#include <gtest/gtest.h>

namespace terrace::fly {
namespace {

using std::chrono::system_clock;

constexpr system_clock::time_point kNow =
    std::chrono::sys_days(std::chrono::year(2026) / 11 / 30) + std::chrono::hours(10);

TEST(RetryAfter, IsANumberOfSeconds) {
  EXPECT_EQ(RetryAfterSeconds("0", "", kNow), 0);
  EXPECT_EQ(RetryAfterSeconds("120", "Mon, 30 Nov 2026 10:00:00 GMT", kNow), 120);
}

TEST(RetryAfter, IsADateThatCountsFromTheServersOwn) {
  EXPECT_EQ(RetryAfterSeconds("Mon, 30 Nov 2026 10:01:30 GMT", "", kNow), 90);
  EXPECT_EQ(RetryAfterSeconds("Mon, 30 Nov 2026 10:01:30 GMT", "no date", kNow), 90);
  // The server's clock is an hour behind.
  EXPECT_EQ(RetryAfterSeconds("Mon, 30 Nov 2026 09:00:07 GMT", "Mon, 30 Nov 2026 09:00:00 GMT", kNow), 7);
  EXPECT_EQ(RetryAfterSeconds("Tue, 01 Dec 2026 00:00:00 GMT", "Mon, 30 Nov 2026 23:59:58 GMT", kNow), 2);
  EXPECT_EQ(RetryAfterSeconds("Sun, 06 Nov 1994 08:49:37 GMT", "", kNow), 0);
  for (const char* sent : {"", "Mon, 30 Nov 2026 10:00:00 GMT"}) {
    EXPECT_GT(RetryAfterSeconds("Fri, 31 Dec 9999 23:59:59 GMT", sent, kNow).value(), 1e11);
  }
}

TEST(RetryAfter, IsNothingOtherwise) {
  for (const char* text :
       {"", "-1", "inf", "nan", "soon", "12 s", "Mon, 30 Nov 2026 10:01:30 CET", "Mon, 30 Non 2026 10:01:30 GMT",
        "Mon, 31 Nov 2026 10:01:30 GMT", "Mon, 30 ovD 2026 10:01:30 GMT", "Mon, 30 Nov 2026 1x:01:30 GMT",
        "Monday, 30-Nov-26 10:01:30 GMT", "Mon, 30 Nov 2026 24:01:30 GMT", "Mon, 30 Nov 2026 10:60:30 GMT"}) {
    EXPECT_EQ(RetryAfterSeconds(text, "", kNow), std::nullopt) << text;
  }
}

}  // namespace
}  // namespace terrace::fly
