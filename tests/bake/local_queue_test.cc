#include "bake/queue/local_queue.h"

#include <gtest/gtest.h>

namespace terrace::bake {
namespace {

using State = UnitQueue::Taken::State;

const Error kWhy{ErrorCode::kUnavailable, "the disk is full"};

TEST(LocalQueue, HandsOutEachUnitOnceInOrder) {
  LocalQueue queue(2);
  EXPECT_EQ(queue.Take().unit, 0U);
  EXPECT_EQ(queue.Take().unit, 1U);
  EXPECT_EQ(queue.Take().state, State::kWait);
  queue.Done(0);
  EXPECT_EQ(queue.Take().state, State::kWait) << "unit 1 may fail";
  queue.Done(1);
  EXPECT_EQ(queue.Take().state, State::kOver);
}

TEST(LocalQueue, AUnitThatFailsComesAgainAfterTheOthersAndIsGivenUpTheThirdTime) {
  LocalQueue queue(2);
  EXPECT_EQ(queue.Take().unit, 0U);
  EXPECT_TRUE(queue.Fail(0, kWhy));
  EXPECT_EQ(queue.Take().unit, 1U);
  queue.Done(1);
  for (int attempt = 1; attempt < kMaxAttempts; ++attempt) {
    const UnitQueue::Taken again = queue.Take();
    ASSERT_EQ(again.state, State::kUnit);
    EXPECT_EQ(again.attempt, attempt);
    EXPECT_EQ(queue.Fail(0, kWhy), attempt + 1 < kMaxAttempts);
  }
  EXPECT_EQ(queue.Take().state, State::kOver);
}

TEST(LocalQueue, AChangedSourceIsTriedOnceMoreOnly) {
  LocalQueue queue(1);
  queue.Take();
  EXPECT_TRUE(queue.Fail(0, {ErrorCode::kChanged, "changed"}));
  queue.Take();
  EXPECT_FALSE(queue.Fail(0, {ErrorCode::kChanged, "changed"}));
}

}  // namespace
}  // namespace terrace::bake
