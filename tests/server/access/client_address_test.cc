#include "server/access/client_address.h"

#include <gtest/gtest.h>

namespace terrace::server {
namespace {

asio::ip::address At(const char* text) { return asio::ip::make_address(text); }

Proxies Trusting(const std::vector<std::string>& ranges,
                 config::ForwardedHeader header = config::ForwardedHeader::kXForwarded) {
  return {*AddressRanges::Parse(ranges), header};
}

TEST(AddressRanges, ContainWhatTheySay) {
  const AddressRanges ranges =
      *AddressRanges::Parse({"10.0.0.0/8", "192.0.2.7", "192.168.128.0/17", "fd00::/8", "::1"});
  for (const char* inside :
       {"10.0.0.0", "10.255.255.255", "192.0.2.7", "192.168.255.1", "fd12::1", "::1", "::ffff:10.1.2.3"}) {
    EXPECT_TRUE(ranges.Contains(At(inside))) << inside;
  }
  for (const char* outside :
       {"11.0.0.0", "9.255.255.255", "192.0.2.6", "192.168.127.255", "fe00::1", "::2", "::a00:1"}) {
    EXPECT_FALSE(ranges.Contains(At(outside))) << outside;
  }
  EXPECT_TRUE(AddressRanges::Parse({"0.0.0.0/0"})->Contains(At("203.0.113.1")));
  EXPECT_FALSE(AddressRanges::Parse({"0.0.0.0/0"})->Contains(At("2001:db8::1")));
  EXPECT_FALSE(AddressRanges().Contains(At("127.0.0.1")));
}

TEST(AddressRanges, RefuseOtherText) {
  for (const char* text : {"", "localhost", "10.0.0.0/33", "10.0.0.0/", "10.0.0.0/-1", "10.0.0.0/08", "::/129", "1.2.3",
                           "[::1]", "10.0.0.0/8/8", "::ffff:10.0.0.0/104", "::ffff:10.0.0.0/8"}) {
    EXPECT_FALSE(AddressRanges::Parse({text})) << text;
  }
  using std::string_literals::operator""s;
  EXPECT_FALSE(AddressRanges::Parse({"10.0.0.1\0x"s}));
  EXPECT_TRUE(AddressRanges::Parse({"::ffff:10.0.0.1"})->Contains(At("10.0.0.1")));
}

TEST(ClientBlock, IsAnAddressOrANetwork) {
  EXPECT_EQ(ClientBlock(At("192.0.2.1")), "192.0.2.1");
  EXPECT_EQ(ClientBlock(At("::ffff:192.0.2.1")), "192.0.2.1");
  EXPECT_EQ(ClientBlock(At("2001:db8:1:2:3:4:5:6")), "2001:db8:1:2::/64");
  EXPECT_EQ(ClientBlock(At("2001:db8:1:2::7")), ClientBlock(At("2001:db8:1:2:ffff::")));
}

TEST(ResolveClient, IsTheLastThatIsNoProxy) {
  const Proxies proxies = Trusting({"10.0.0.0/8"});
  const struct {
    const char *peer, *forwarded_for, *client;
  } cases[] = {
      {"10.0.0.1", "192.0.2.1", "192.0.2.1"},
      {"10.0.0.1", "192.0.2.1, 10.0.0.2", "192.0.2.1"},
      {"10.0.0.1", "8.8.8.8, 192.0.2.1, 10.0.0.2, 10.0.0.3", "192.0.2.1"},
      {"10.0.0.1", "10.0.0.4, 10.0.0.3", "10.0.0.4"},  // from the internal network
      {"10.0.0.1", "", "10.0.0.1"},
      {"10.0.0.1", "unknown", "10.0.0.1"},
      {"10.0.0.1", "192.0.2.1, nonsense, 10.0.0.2", "10.0.0.2"},
      {"10.0.0.1", "192.0.2.1:4711", "192.0.2.1"},
      {"10.0.0.1", "[2001:db8::1]:4711", "2001:db8::1"},
      {"10.0.0.1", "2001:db8::1", "2001:db8::1"},
      {"192.0.2.9", "8.8.8.8", "192.0.2.9"},  // from an untrusted client
      {"::ffff:10.0.0.1", "192.0.2.1", "192.0.2.1"},
  };
  for (const auto& c : cases) {
    Request request;
    request.fields.Set(&RequestFields::forwarded_for, c.forwarded_for);
    request.fields.Set(&RequestFields::forwarded, "for=203.0.113.99");
    EXPECT_EQ(ResolveClient(request, At(c.peer), proxies), At(c.client)) << c.peer << " " << c.forwarded_for;
  }
}

TEST(ResolveClient, TakesSchemeAndHostFromTheNearestProxy) {
  Request request;
  request.fields.Set(&RequestFields::host, "inside");
  request.fields.Set(&RequestFields::forwarded_proto, "http, https");
  request.fields.Set(&RequestFields::forwarded_host, "evil.example, maps.example:8443");
  Request untouched = request;
  ResolveClient(untouched, At("192.0.2.9"), Trusting({"10.0.0.0/8"}));
  EXPECT_EQ(untouched.fields->host, "inside");
  EXPECT_FALSE(untouched.is_https);
  ResolveClient(request, At("10.0.0.1"), Trusting({"10.0.0.0/8"}));
  EXPECT_EQ(request.fields->host, "maps.example:8443");
  EXPECT_TRUE(request.is_https);
  request.fields.Set(&RequestFields::forwarded_host, "a b/c");
  ResolveClient(request, At("10.0.0.1"), Trusting({"10.0.0.0/8"}));
  EXPECT_EQ(request.fields->host, "maps.example:8443") << "what is no host stays away";
}

TEST(ResolveClient, ReadsForwardedWhereThatIsWhatProxiesWrite) {
  const Proxies proxies = Trusting({"10.0.0.0/8"}, config::ForwardedHeader::kForwarded);
  Request request;
  request.fields.Set(&RequestFields::forwarded_for, "203.0.113.99");
  request.fields.Set(
      &RequestFields::forwarded,
      R"(For=8.8.8.8, for="[2001:db8::7]:4711";Proto=HTTPS;host="maps.example", for=10.0.0.2;proto=https;host=maps.example)");
  EXPECT_EQ(ResolveClient(request, At("10.0.0.1"), proxies), At("2001:db8::7"));
  EXPECT_EQ(request.fields->host, "maps.example");
  EXPECT_TRUE(request.is_https);
  for (const char* odd : {"", ";", "for", "for=_hidden", ",,,", "for=\"", "=;=,="}) {
    Request other;
    other.fields.Set(&RequestFields::forwarded, odd);
    EXPECT_EQ(ResolveClient(other, At("10.0.0.1"), proxies), At("10.0.0.1")) << odd;
  }
}

}  // namespace
}  // namespace terrace::server
