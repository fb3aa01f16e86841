#include "config/common/listen_address.h"

#include <gtest/gtest.h>

#include <string>

namespace terrace::config {
namespace {

TEST(ParseListenAddress, ReadsWhatToStringWrites) {
  for (const char* text : {"127.0.0.1:8080", "0.0.0.0:0", "[::1]:8080", "[::]:65535", "[fe80::1:2]:80",
                           "[::ffff:10.0.0.1]:1", "localhost:8080", "tiles.example.org:443", "a-1:2"}) {
    const Result<ListenAddress> address = ParseListenAddress(text);
    ASSERT_TRUE(address) << text << ": " << address.error().message;
    EXPECT_EQ(ToString(*address), text);
  }
}

TEST(ParseListenAddress, TakesBracketsOffIpv6) {
  const Result<ListenAddress> address = ParseListenAddress("[2001:db8::7]:8080");
  ASSERT_TRUE(address);
  EXPECT_EQ(*address, (ListenAddress{"2001:db8::7", 8080}));
}

void ExpectRefused(const char* text, const std::string& part) {
  const Result<ListenAddress> address = ParseListenAddress(text);
  ASSERT_FALSE(address) << text;
  EXPECT_EQ(address.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(address.error().message.find(part), std::string::npos) << text << ": " << address.error().message;
}

TEST(ParseListenAddress, SaysWhatWouldBeRight) {
  ExpectRefused("", "has no port; write HOST:PORT such as 127.0.0.1:8080");
  ExpectRefused("8080", "has no host; write 127.0.0.1:8080");
  ExpectRefused("::1:8080", "must stand in brackets, as in [::1]:8080");
  ExpectRefused("::1", "must stand in brackets");
  ExpectRefused("[::1]", "has no port");
  for (const char* text : {"localhost:", "localhost:http", "localhost:65536", "localhost:-1", "localhost:+1",
                           "localhost: 80", "localhost:80 ", "[::1]:x"}) {
    ExpectRefused(text, "must be a number from 0 (any free port) to 65535");
  }
  for (const char* text : {":8080", "[]:80", "[1.2.3.4]:80", "[localhost]:80", "[::g]:80", "1.2.3:80", "256.0.0.1:80",
                           "a b:80", "-a:80", ".a:80", "[fe80::1%eth0]:80", "http//a:80", "*:80"}) {
    ExpectRefused(text, "is not a host; write HOST:PORT");
  }
}

TEST(ParseListenAddress, TakesThePathOfAUnixSocketOnlyWhereOneMayStand) {
  const Result<ListenAddress> address = ParseListenAddressOrPath("unix:/run/terrace/admin.sock");
  ASSERT_TRUE(address) << address.error().message;
  EXPECT_EQ(address->path, "/run/terrace/admin.sock");
  EXPECT_EQ(ToString(*address), "unix:/run/terrace/admin.sock");
  EXPECT_FALSE(ParseListenAddress("unix:/run/terrace/admin.sock"));
  EXPECT_EQ(ParseListenAddressOrPath("[::1]:8080")->host, "::1");
  const std::string longest = "unix:/" + std::string(106, 'x');
  EXPECT_TRUE(ParseListenAddressOrPath(longest));
  for (const std::string& text : {std::string("unix:"), std::string("unix:/"), std::string("unix:admin.sock"),
                                  std::string("unix:/run/"), longest + "x", std::string("unix:/a\0b", 9)}) {
    const Result<ListenAddress> refused = ParseListenAddressOrPath(text);
    ASSERT_FALSE(refused) << text;
    EXPECT_NE(refused.error().message.find("unix:/run/terrace/admin.sock"), std::string::npos);
  }
}

TEST(ParseListenAddress, RefusesBytesAfterAnEmbeddedNul) {
  EXPECT_FALSE(ParseListenAddress(std::string_view("127.0.0.1\0x:80", 14)));
  EXPECT_FALSE(ParseListenAddress(std::string_view("[::1\0]:80", 9)));
}

}  // namespace
}  // namespace terrace::config
