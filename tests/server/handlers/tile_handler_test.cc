#include <gtest/gtest.h>

#include "server/handlers/handlers.h"

namespace terrace::server {
namespace {

TEST(TileHandler, TimesTheStepsOfABuild) {
  tiler::StageTimes times;
  times.queue = std::chrono::microseconds(3);
  times.read = std::chrono::microseconds(1500);
  times.refine = std::chrono::microseconds(20);
  EXPECT_EQ(FormatServerTiming("miss", times),
            "cache;desc=miss, queue;dur=0.003, read;dur=1.500, refine;dur=0.020, encode;dur=0.000, compress;dur=0.000");
  EXPECT_TRUE(FormatServerTiming("join", times).starts_with("cache;desc=join, queue;dur=0.003, read;"));
}

}  // namespace
}  // namespace terrace::server
