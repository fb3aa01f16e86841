#include "server/http/request.h"

#include <gtest/gtest.h>

#include <tuple>
#include <vector>

namespace terrace::server {
namespace {

std::string Get(const std::string& fields) { return "GET / HTTP/1.1\r\nHost: x\r\n" + fields + "\r\n"; }

// All fields of a parsed head.
auto Said(const Request& r) {
  return std::tuple(r.method, r.version, r.keep_alive, r.method_name, r.target, *r.fields, r.content_length,
                    r.expects_continue);
}

TEST(HeadMemo, ChangesNoRequest) {
  const std::vector<std::string> lines = {"GET /a HTTP/1.1",
                                          "HEAD /a?b=c HTTP/1.1",
                                          "GET /a?token=secret&b HTTP/1.1",
                                          "GET /%74?%74oken=x HTTP/1.1",
                                          "GET /a HTTP/1.0",
                                          "GET http://x/a HTTP/1.1",
                                          "GET  /a HTTP/1.1",
                                          "GET /a b HTTP/1.1",
                                          "GET /a\tb HTTP/1.1",
                                          "GET /\xc3\xa4 HTTP/1.1",
                                          "GET /a HTTP/1.1 ",
                                          "GET / HTTP/2.0",
                                          "GET HTTP/1.1",
                                          "POST /a HTTP/1.1",
                                          "OPTIONS * HTTP/1.1",
                                          "get /a HTTP/1.1",
                                          "GET /" + std::string(kMaxTargetBytes - 1, 'a') + " HTTP/1.1",
                                          "GET /" + std::string(kMaxTargetBytes, 'a') + " HTTP/1.1",
                                          "x HTTP/1.1\r\nGET /a HTTP/1.1",
                                          ""};
  const std::vector<std::string> headers = {"Host: x\r\n",
                                            "Host: x\r\nAccept: a/b\r\nAuthorization: Bearer t\r\n",
                                            "Host: x\r\nConnection: close\r\n",
                                            "Host: x\r\nContent-Length: 0\r\n",
                                            "Host: x\r\nContent-Length: 3\r\n",
                                            "Host: x\r\nExpect: 100-continue\r\n",
                                            "Host: x\r\nTransfer-Encoding: chunked\r\n",
                                            " folded: x\r\n",
                                            "Host: a b\r\n",
                                            "Host: x\r\nIf-None-Match: \"a\"\r\nX-Forwarded-For: 10.0.0.1\r\n",
                                            ""};
  std::vector<std::string> heads;
  for (const std::string& line : lines) {
    for (const std::string& header : headers) heads.push_back(line + "\r\n" + header + "\r\n");
  }
  int repeated = 0;
  for (const std::string& first : heads) {
    HeadMemo primed;
    (void)ParseHead(first, &primed);
    for (const std::string& second : heads) {
      const auto plain = ParseHead(second);
      Request taken;
      taken.client = 7;  // from the previous request
      const std::size_t size = TakeRepeated(second + "GET / HTTP/1.1\r\n", primed, taken);
      if (size == 0) continue;
      ++repeated;
      EXPECT_EQ(size, second.size());
      ASSERT_TRUE(plain) << first << second;
      EXPECT_EQ(FindHeadEnd(second, 0), size);
      EXPECT_EQ(Said(*plain), Said(taken)) << first << second;
      EXPECT_EQ(taken.client, 0U);
      EXPECT_TRUE(taken.is_private);
    }
  }
  EXPECT_GT(repeated, 100);  // the shortcut is used
}

TEST(Request, ReadsWhatMatters) {
  const auto request = ParseHead(
      "GET /a?b HTTP/1.1\r\nHost: localhost:8080\r\nAccept: a/b\r\naccept: c/d\r\nACCEPT-ENCODING: gzip\r\n"
      "If-None-Match: \"x\"\r\nIf-None-Match: \"y\"\r\n\r\n");
  ASSERT_TRUE(request) << request.error().detail;
  EXPECT_EQ(request->method, Method::kGet);
  EXPECT_EQ(request->version, 11u);
  EXPECT_TRUE(request->keep_alive);
  EXPECT_EQ(request->target, "/a?b");
  EXPECT_EQ(request->fields->accept, "a/b, c/d");
  EXPECT_EQ(request->fields->accept_encoding, "gzip");
  EXPECT_EQ(request->fields->if_none_match, "\"x\", \"y\"");
}

TEST(Request, KnowsItsMethodAndPersistence) {
  EXPECT_EQ(ParseHead("HEAD / HTTP/1.1\r\nHost: x\r\n\r\n")->method, Method::kHead);
  EXPECT_EQ(ParseHead("OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\n")->method, Method::kOptions);
  EXPECT_EQ(ParseHead("DELETE / HTTP/1.1\r\nHost: x\r\n\r\n")->method, Method::kOther);
  EXPECT_EQ(ParseHead("BREW / HTTP/1.1\r\nHost: x\r\n\r\n")->method, Method::kOther);
  EXPECT_FALSE(ParseHead("GET / HTTP/1.0\r\n\r\n")->keep_alive);
  EXPECT_TRUE(ParseHead("GET / HTTP/1.0\r\nConnection: keep-alive\r\n\r\n")->keep_alive);
  EXPECT_EQ(ParseHead("GET / HTTP/1.0\r\n\r\n")->version, 10u);
  EXPECT_FALSE(ParseHead(Get("Connection: close\r\n"))->keep_alive);
}

TEST(Request, AcceptsALengthOfZeroOnly) {
  EXPECT_TRUE(ParseHead(Get("Content-Length: 0\r\n")));
  for (const char* length : {"5", "00", "+0", "-0", "0x0", "0, 0", "", "18446744073709551616"}) {
    EXPECT_FALSE(ParseHead(Get("Content-Length: " + std::string(length) + "\r\n"))) << length;
  }
  EXPECT_FALSE(ParseHead(Get("Content-Length: 0\r\nContent-Length: 0\r\n")));
}

TEST(Request, APostMayAnnounceABody) {
  const auto post = [](const std::string& fields) {
    return ParseHead("POST /a HTTP/1.1\r\nHost: x\r\n" + fields + "\r\n");
  };
  const auto request = post("Content-Length: 12\r\nContent-Type: application/json\r\nExpect: 100-Continue\r\n");
  ASSERT_TRUE(request) << request.error().detail;
  EXPECT_EQ(request->method, Method::kPost);
  EXPECT_EQ(request->content_length, 12u);
  EXPECT_EQ(request->fields->content_type, "application/json");
  EXPECT_TRUE(request->expects_continue);
  EXPECT_EQ(post("")->content_length, 0u);
  EXPECT_FALSE(post("")->expects_continue);
  const auto old = ParseHead("POST /a/heights HTTP/1.0\r\nContent-Length: 12\r\nExpect: 100-continue\r\n\r\n");
  ASSERT_TRUE(old);
  EXPECT_FALSE(old->expects_continue) << "HTTP/1.0 knows no interim replies";
  for (const char* length : {"05", "00", "+5", "-5", "5 5", "5,5", "0x5", "5.0", "", "1234567890123456"}) {
    EXPECT_FALSE(post("Content-Length: " + std::string(length) + "\r\n")) << length;
  }
  EXPECT_FALSE(post("Content-Length: 5\r\nContent-Length: 5\r\n"));
  EXPECT_FALSE(post("Content-Length: 5\r\nTransfer-Encoding: chunked\r\n"));
}

TEST(Request, RefusesEveryTransferEncoding) {
  for (const char* coding : {"chunked", "gzip", "identity", "gzip, chunked", "xchunked", " chunked", "\tchunked", ""}) {
    EXPECT_FALSE(ParseHead(Get("Transfer-Encoding: " + std::string(coding) + "\r\n"))) << coding;
  }
  EXPECT_FALSE(ParseHead("GET / HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n"));
}

TEST(Request, RefusesAmbiguousHeads) {
  for (const char* head : {
           "GET / HTTP/1.1\r\n\r\n",                                           // no Host
           "GET / HTTP/1.1\r\nHost: x\r\nHost: x\r\n\r\n",                     // two
           "GET / HTTP/1.1\r\nHost: a b\r\n\r\n",                              // not a host
           "GET / HTTP/1.1\r\nHost: x/y\r\n\r\n",                              //
           "GET / HTTP/1.1\r\nHost: x\r\nA: b\r\n Content-Length: 5\r\n\r\n",  // folded
           "GET / HTTP/1.1\r\nHost: x\r\nA: b\r\n\tTransfer-Encoding: chunked\r\n\r\n",
           "GET / HTTP/1.1\r\n Host: x\r\n\r\n",                       //
           "GET / HTTP/1.1\r\nHost: x\r\nContent-Length : 0\r\n\r\n",  // blank before the colon
           "GET / HTTP/1.1\r\nHost: x\r\n: y\r\n\r\n",                 // no name
           "GET / HTTP/1.1\r\nHost: x\r\nnonsense\r\n\r\n",            // no colon
           "GET / HTTP/1.1\r\nHost: x\r\nA: b\rC: d\r\n\r\n",          // bare CR
           "GET / HTTP/1.1\r\nHost: x\r\nA: \x01\r\n\r\n",             // control character
           "GET / HTTP/1.1\r\nHost: x\r\nA(: b\r\n\r\n",               // not a token
           "GET / HTTP/2.0\r\nHost: x\r\n\r\n",
           "GET / HTTP/1.2\r\nHost: x\r\n\r\n",
           "GET / HTTP/0.9\r\nHost: x\r\n\r\n",
           "GET / http/1.1\r\nHost: x\r\n\r\n",
           "GET /\r\nHost: x\r\n\r\n",
           "GET  / HTTP/1.1\r\nHost: x\r\n\r\n",
           "GET / HTTP/1.1 \r\nHost: x\r\n\r\n",
           "GET /a b HTTP/1.1\r\nHost: x\r\n\r\n",
           " GET / HTTP/1.1\r\nHost: x\r\n\r\n",
           "G@T / HTTP/1.1\r\nHost: x\r\n\r\n",
           "/ HTTP/1.1\r\nHost: x\r\n\r\n",
       }) {
    const auto request = ParseHead(head);
    ASSERT_FALSE(request) << head;
    EXPECT_EQ(request.error().status, 400) << head;
  }
}

TEST(Request, NamesUsualCausesWhereItCannotBeRead) {
  const auto request = ParseHead("GET /a b HTTP/1.1\r\nHost: x\r\n\r\n");
  ASSERT_FALSE(request);
  EXPECT_NE(request.error().detail.find("%20"), std::string_view::npos) << request.error().detail;
}

TEST(Request, ReadsTheBearersToken) {
  EXPECT_EQ(ParseHead(Get("Authorization: bearer  s \r\n"))->fields->bearer, "s");
  const auto basic = ParseHead(Get("Authorization: Basic abc\r\n"));
  EXPECT_FALSE(basic->fields->bearer);
  EXPECT_TRUE(basic->fields->has_authorization);
}

TEST(Request, RefusesNulBytes) {
  using std::string_view_literals::operator""sv;
  EXPECT_FALSE(ParseHead("GET / HTTP/1.1\r\nHost: x\r\nA: b\0c\r\n\r\n"sv));
  EXPECT_FALSE(ParseHead("GET /\0 HTTP/1.1\r\nHost: x\r\n\r\n"sv));
}

TEST(HeadEnd, IsFoundWhereverTheReadsAreCut) {
  const std::string head = Get("A: b\r\n");
  const std::string stream = head + "GET /next";
  for (std::size_t cut = 0; cut < head.size(); ++cut) {
    EXPECT_EQ(*FindHeadEnd(stream.substr(0, cut), 0), 0u);
    EXPECT_EQ(*FindHeadEnd(stream, cut), head.size()) << cut;
  }
}

TEST(HeadEnd, BoundsTheTargetAndTheHead) {
  const std::string fits(kMaxTargetBytes - 1, 'a');
  EXPECT_TRUE(ParseHead("GET /" + fits + " HTTP/1.1\r\nHost: x\r\n\r\n"));
  EXPECT_EQ(ParseHead("GET /" + fits + "a HTTP/1.1\r\nHost: x\r\n\r\n").error().status, 414);
  EXPECT_EQ(FindHeadEnd("GET /" + std::string(kMaxTargetBytes + 100, 'a'), 0), 0u) << "a field Origin may follow";
  EXPECT_EQ(FindHeadEnd("GET /" + std::string(kMaxHeadBytes, 'a'), 0).error().status, 414);
  EXPECT_EQ(FindHeadEnd(Get("A: " + std::string(kMaxHeadBytes, 'b')), 0).error().status, 431);
  EXPECT_EQ(FindHeadEnd(Get("").substr(0, 20) + std::string(kMaxHeadBytes, 'b'), 0).error().status, 431);
}

TEST(HeadEnd, RefusesLinesWithoutCr) {
  EXPECT_EQ(FindHeadEnd("GET / HTTP/1.1\nHost: x\n\n", 0).error().status, 400);
  EXPECT_EQ(FindHeadEnd("GET / HTTP/1.1\r\nA: b\nHost: x\r\n\r\n", 0).error().status, 400);
  EXPECT_EQ(FindHeadEnd("\n", 0).error().status, 400);
}

TEST(RefusedRequest, HasMethodTargetAndOrigin) {
  const Request head =
      RefusedRequestOf("HEAD /maui/layer.json?token=secret-1&x=1 HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n");
  EXPECT_EQ(head.method, Method::kHead);
  EXPECT_EQ(head.method_name, "HEAD");
  EXPECT_EQ(head.target, "/maui/layer.json?token=secret-1&x=1");
  EXPECT_TRUE(head.is_private);
  EXPECT_EQ(head.fields->origin, "");
  EXPECT_EQ(RefusedRequestOf("GET / HTTP/1.1\r\nHost: a\r\nORIGIN: https://a \r\nHost: b\r\n\r\n").fields->origin,
            "https://a");
  for (const char* several : {"GET / HTTP/1.1\r\nOrigin: a\r\nOrigin: b\r\n\r\n", "GET / HTTP/1.1\r\n\r\nOrigin: a\r\n",
                              "GET / HTTP/1.1\r\nOrigin: a"}) {
    EXPECT_EQ(RefusedRequestOf(several).fields->origin, "") << several;
  }
  const Request cut = RefusedRequestOf("GET /" + std::string(100, 'a'));
  EXPECT_EQ(cut.method, Method::kGet);
  EXPECT_EQ(cut.target, "/" + std::string(100, 'a'));
  for (const char* bytes : {"", "GET", "get / HTTP/1.1\r\n", "\x16\x03\x01 \x01\r\n", " / HTTP/1.1\r\n"}) {
    EXPECT_EQ(RefusedRequestOf(bytes).method, Method::kOther) << bytes;
    EXPECT_EQ(RefusedRequestOf(bytes).method_name, "") << bytes;
  }
}

}  // namespace
}  // namespace terrace::server
