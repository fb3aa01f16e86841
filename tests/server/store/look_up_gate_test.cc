#include "server/store/look_up_gate.h"

#include <gtest/gtest.h>

namespace terrace::server {
namespace {

TEST(LookUpGate, AsksWhileSomethingIsFound) {
  LookUpGate gate;
  for (int i = 0; i < 10'000; ++i) {
    ASSERT_TRUE(gate.ShouldLookUp(3)) << i;
    gate.Note(3, i % 5 == 0);
  }
}

TEST(LookUpGate, StopsWhereNothingIsFoundAndSeesWhenSomethingIs) {
  LookUpGate gate;
  int asked = 0;
  for (int i = 0; i < 10'000; ++i) {
    if (!gate.ShouldLookUp(3)) continue;
    ++asked;
    gate.Note(3, false);
  }
  EXPECT_LT(asked, 10'000 / static_cast<int>(LookUpGate::kSample) + 400);
  EXPECT_TRUE(gate.ShouldLookUp(4)) << "another kind";
  for (int i = 0; i < 20 * static_cast<int>(LookUpGate::kSample); ++i) {
    if (gate.ShouldLookUp(3)) gate.Note(3, true);
  }
  EXPECT_TRUE(gate.ShouldLookUp(3));
  EXPECT_TRUE(gate.ShouldLookUp(3));
}

}  // namespace
}  // namespace terrace::server
