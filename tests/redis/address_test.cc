#include "redis/address.h"

#include <gtest/gtest.h>

namespace terrace::redis {
namespace {

TEST(RedisAddress, HasThePartsOfTheUrl) {
  const auto address = ParseAddress("rediss://baker:p%40ss%2Fword@redis.example:6380/3");
  ASSERT_TRUE(address) << address.error().message;
  EXPECT_TRUE(address->is_tls);
  EXPECT_EQ(address->host, "redis.example");
  EXPECT_EQ(address->port, 6380);
  EXPECT_EQ(address->user, "baker");
  EXPECT_EQ(address->password, "p@ss/word");
  EXPECT_EQ(address->database, 3);
  EXPECT_EQ(address->Text(), "rediss://redis.example:6380/3");
}

TEST(RedisAddress, HasDefaults) {
  const auto address = ParseAddress("redis://:secret@[::1]");
  ASSERT_TRUE(address) << address.error().message;
  EXPECT_EQ(address->host, "::1");
  EXPECT_EQ(address->port, 6379);
  EXPECT_EQ(address->user, "");
  EXPECT_EQ(address->password, "secret");
  EXPECT_EQ(address->Text(), "redis://[::1]:6379/0");
}

TEST(RedisAddress, IsRefusedWithoutRepeatingThePassword) {
  for (const char* const url :
       {"", "http://h", "redis://", "redis://u:secret@", "redis://u:secret@h:0", "redis://u:secret@h:70000",
        "redis://u:secret@h:x/0", "redis://u:secret@h/-1", "redis://u:secret@h/1x", "redis://u:secret%g0@h",
        "redis://u:secret%4@h", "redis://u:secret@[::1", "redis://u:sec/ret@h:x", "u:secret@h"}) {
    const auto address = ParseAddress(url);
    ASSERT_FALSE(address) << url;
    EXPECT_EQ(address.error().code, ErrorCode::kInvalidArgument);
    EXPECT_EQ(address.error().message.find("sec"), std::string::npos) << address.error().message;
    // The shared cache takes no password in its URL.
    EXPECT_EQ(address.error().message.find("password@"), std::string::npos) << address.error().message;
  }
}

}  // namespace
}  // namespace terrace::redis
