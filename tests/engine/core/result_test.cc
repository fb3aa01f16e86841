#include "engine/core/result.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "engine/core/check.h"

namespace terrace {
namespace {

Result<int> Half(int value) {
  if (value % 2 != 0) return MakeError(ErrorCode::kInvalidArgument, "{} is odd: give an even number", value);
  return value / 2;
}

TEST(Result, HoldsAValueOrAnError) {
  EXPECT_EQ(Half(8).value(), 4);
  const Result<int> failed = Half(7);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, ErrorCode::kInvalidArgument);
  EXPECT_EQ(failed.error().message, "7 is odd: give an even number");
}

TEST(ErrorCode, HasItsOwnName) {
  std::set<std::string> names;
  for (const ErrorCode code :
       {ErrorCode::kInvalidArgument, ErrorCode::kNotFound, ErrorCode::kUnavailable, ErrorCode::kChanged,
        ErrorCode::kOverloaded, ErrorCode::kCancelled, ErrorCode::kInternal}) {
    names.emplace(ToString(code));
  }
  EXPECT_EQ(names.size(), 7u);
  EXPECT_TRUE(names.contains("not_found"));
}

TEST(CheckDeathTest, NamesTheConditionAndThePlace) {
  TERRACE_CHECK(1 + 1 == 2);
  EXPECT_DEATH(TERRACE_CHECK(1 + 1 == 3), "result_test.cc:[0-9]+: check failed: 1 \\+ 1 == 3");
}

}  // namespace
}  // namespace terrace
