#include "engine/core/nearest_name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace terrace {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

const std::vector<KnownName> kKeys = {{"listen", "port host"}, {"datasets"},      {"cache_bytes", "cache"},
                                      {"disk_cache", "cache"}, {"io_threads"},    {"worker_threads"},
                                      {"header_timeout_s"},    {"idle_timeout_s"}};
const std::vector<KnownName> kFlags = {{"--out"}, {"--max-error"}, {"--threads"}, {"--json"}};

TEST(NearestNames, FindWhatWasMeant) {
  EXPECT_THAT(NearestNames("listen", kKeys), ElementsAre("listen"));
  EXPECT_THAT(NearestNames("lisetn", kKeys), ElementsAre("listen"));  // a swap counts one
  EXPECT_THAT(NearestNames("Listen", kKeys), ElementsAre("listen"));
  EXPECT_THAT(NearestNames("dataset", kKeys), ElementsAre("datasets"));
  EXPECT_THAT(NearestNames("cache-bytes", kKeys), ElementsAre("cache_bytes"));
  EXPECT_THAT(NearestNames("cachebytes", kKeys), ElementsAre("cache_bytes"));
  EXPECT_THAT(NearestNames("workers_threads", kKeys), ElementsAre("worker_threads"));
}

TEST(NearestNames, KnowWhatOthersCallIt) {
  for (const char* word : {"port", "host", "Port", "--port", "--host"}) {
    EXPECT_THAT(NearestNames(word, kKeys), ElementsAre("listen")) << word;
  }
  EXPECT_THAT(NearestNames("cache", kKeys), ElementsAre("cache_bytes", "disk_cache"));
  EXPECT_THAT(NearestNames("ort", kKeys), IsEmpty()) << "no whole word";
  EXPECT_THAT(NearestNames("port host", kKeys), IsEmpty());
}

TEST(NearestNames, AreAllThatHaveThatPart) {
  EXPECT_THAT(NearestNames("--io", kKeys), ElementsAre("io_threads"));
  EXPECT_THAT(NearestNames("timeout", kKeys), ElementsAre("header_timeout_s", "idle_timeout_s"));
  EXPECT_THAT(NearestNames("error", kFlags), ElementsAre("--max-error"));
  EXPECT_THAT(NearestNames("ach", kKeys), IsEmpty()) << "no whole part";
  EXPECT_THAT(NearestNames("__", kKeys), IsEmpty());
  const std::vector<KnownName> many = {{"a_x"}, {"b_x"}, {"c_x"}, {"d_x"}, {"e_x"}};
  EXPECT_THAT(NearestNames("x", many), IsEmpty()) << "which of five?";
}

TEST(NearestNames, MayBeTheBeginningOfTheWord) {
  EXPECT_THAT(NearestNames("--output", kFlags), ElementsAre("--out"));
  EXPECT_THAT(NearestNames("listen_address", kKeys), ElementsAre("listen"));
  EXPECT_THAT(NearestNames("listenVk3tSecretMarker42xyz", kKeys), IsEmpty()) << "the rest may be a secret";
}

TEST(NearestNames, CountNoDashesAtTheBeginning) {
  EXPECT_THAT(NearestNames("--port", kFlags), IsEmpty()) << "--out has two other letters of three";
}

TEST(NearestNames, AreEmptyWhenNothingIsNear) {
  EXPECT_THAT(NearestNames("colour", kKeys), IsEmpty());
  EXPECT_THAT(NearestNames("", kKeys), IsEmpty());
  EXPECT_THAT(NearestNames("listen", {}), IsEmpty());
  EXPECT_THAT(NearestNames(std::string(1'000'000, 'x'), kKeys), IsEmpty());
}

TEST(NearestNames, PreferTheFirstOfEquals) {
  const std::vector<KnownName> names = {{"abcd"}, {"abce"}};
  EXPECT_THAT(NearestNames("abcx", names), ElementsAre("abcd"));
}

TEST(IsSameName, IgnoresCaseAndDashes) {
  EXPECT_TRUE(IsSameName("--Cache-Bytes", "cache_bytes"));
  EXPECT_FALSE(IsSameName("cachebytes", "cache_bytes"));
}

TEST(Alternatives, AreJoinedByOr) {
  const std::vector<std::string> three = {"a", "b", "c"};
  EXPECT_EQ(Alternatives(three), "a, b or c");
  EXPECT_EQ(Alternatives(std::span(three).first(2)), "a or b");
  EXPECT_EQ(Alternatives(std::span(three).first(1)), "a");
  EXPECT_EQ(Alternatives({}), "");
}

}  // namespace
}  // namespace terrace
