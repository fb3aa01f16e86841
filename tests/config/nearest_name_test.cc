#include "config/common/nearest_name.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace terrace::config {
namespace {

const std::vector<std::string_view> kKeys = {"listen", "datasets", "cache_bytes", "io_threads", "worker_threads"};

TEST(NearestName, FindsWhatWasMeant) {
  EXPECT_EQ(NearestName("listen", kKeys), "listen");
  EXPECT_EQ(NearestName("lisetn", kKeys), "listen");  // a swap counts one
  EXPECT_EQ(NearestName("Listen", kKeys), "listen");
  EXPECT_EQ(NearestName("dataset", kKeys), "datasets");
  EXPECT_EQ(NearestName("cache-bytes", kKeys), "cache_bytes");
  EXPECT_EQ(NearestName("cachebytes", kKeys), "cache_bytes");
  EXPECT_EQ(NearestName("workers_threads", kKeys), "worker_threads");
}

TEST(NearestName, FindsTheOnlyNameWithThatPart) {
  EXPECT_EQ(NearestName("cache", kKeys), "cache_bytes");
  EXPECT_EQ(NearestName("--io", kKeys), "io_threads");
  const std::vector<std::string_view> two = {"finest_error", "max_error_m"};
  EXPECT_EQ(NearestName("error", two), "") << "two names have it";
  EXPECT_EQ(NearestName("ach", kKeys), "") << "no whole part";
  EXPECT_EQ(NearestName("__", kKeys), "");
}

TEST(NearestName, IsEmptyWhenNothingIsNear) {
  EXPECT_EQ(NearestName("colour", kKeys), "");
  EXPECT_EQ(NearestName("", kKeys), "");
  EXPECT_EQ(NearestName("listen", {}), "");
  EXPECT_EQ(NearestName(std::string(1'000'000, 'x'), kKeys), "");
}

TEST(NearestName, PrefersTheFirstOfEquals) {
  const std::vector<std::string_view> names = {"abcd", "abce"};
  EXPECT_EQ(NearestName("abcx", names), "abcd");
}

}  // namespace
}  // namespace terrace::config
