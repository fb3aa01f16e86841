// The requirements of RFC 9110, 9112 and 3986 for a server of HTTP/1.1, case by case, on raw sockets. Row 8 of
// docs/reliability.md.
#include <gtest/gtest.h>

#include <regex>
#include <string>
#include <vector>

#include "tests/server/server_fixture.h"

namespace terrace::server {
namespace {

using namespace std::string_literals;

struct Rule {
  const char* says;
  std::string sent;
  std::vector<int> statuses;  // of the replies, in order
  bool stays_open = true;
};

constexpr bool kCloses = false;

std::string Head(const std::string& request_line, const std::string& fields = "Host: x\r\n") {
  return request_line + "\r\n" + fields + "\r\n";
}
std::string With(const std::string& fields) { return Head("GET /livez HTTP/1.1", "Host: x\r\n" + fields); }

std::string PostOf(const std::string& fields, const std::string& body, const std::string& version = "1.1") {
  return "POST /maui/heights HTTP/" + version +
         "\r\nHost: x\r\nContent-Type: application/json\r\nContent-Length: " + std::to_string(body.size()) + "\r\n" +
         fields + "\r\n" + body;
}

const std::string kBody = R"({"locations": "5,7"})";

std::vector<Rule> RequestLines() {
  return {
      {"origin form", Head("GET /livez HTTP/1.1"), {200}},
      {"origin form with a query", Head("GET /livez?v=1 HTTP/1.1"), {200}},
      {"absolute form", Head("GET http://x/livez HTTP/1.1"), {200}},
      {"absolute form, https", Head("GET https://x:443/livez HTTP/1.1"), {200}},
      {"schemes have no case", Head("GET HTTP://x/livez HTTP/1.1"), {200}},
      {"absolute form without a path", Head("GET http://x HTTP/1.1"), {200}},
      {"absolute form whose host is another than Host's", Head("GET http://y/livez HTTP/1.1"), {200}},
      {"absolute form without a host", Head("GET http:///livez HTTP/1.1"), {400}, kCloses},
      {"absolute form with a user", Head("GET http://me@x/livez HTTP/1.1"), {400}, kCloses},
      {"other schemes", Head("GET ftp://x/livez HTTP/1.1"), {400}},
      {"asterisk form of OPTIONS", Head("OPTIONS * HTTP/1.1"), {204}},
      {"asterisk form of others", Head("GET * HTTP/1.1"), {400}},
      {"authority form", Head("CONNECT x:80 HTTP/1.1"), {405}, kCloses},
      {"no slash at the beginning", Head("GET livez HTTP/1.1"), {400}},
      {"a fragment", Head("GET /livez#a HTTP/1.1"), {400}},
      {"methods have case", Head("get /livez HTTP/1.1"), {405}, kCloses},
      {"a method that is none", Head("BREW /livez HTTP/1.1"), {405}, kCloses},
      {"TRACE is not offered", Head("TRACE /livez HTTP/1.1"), {405}, kCloses},
      {"a method that is no token", Head("G(T /livez HTTP/1.1"), {400}, kCloses},
      {"no method", Head(" /livez HTTP/1.1"), {400}, kCloses},
      {"empty lines before a request", "\r\n\r\n" + Head("GET /livez HTTP/1.1"), {200}},
      {"blanks before a request", " " + Head("GET /livez HTTP/1.1"), {400}, kCloses},
      {"two blanks", Head("GET  /livez HTTP/1.1"), {400}, kCloses},
      {"a tab for a blank", Head("GET\t/livez HTTP/1.1"), {400}, kCloses},
      {"a blank in the target", Head("GET /li vez HTTP/1.1"), {400}, kCloses},
      {"a blank after the version", Head("GET /livez HTTP/1.1 "), {400}, kCloses},
      {"no version", Head("GET /livez"), {400}, kCloses},
      {"HTTP/0.9", "GET /livez\r\n\r\n", {400}, kCloses},
      {"HTTP/2.0", Head("GET /livez HTTP/2.0"), {400}, kCloses},
      {"HTTP/2's preface", "PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n", {400}, kCloses},
      {"the version has case", Head("GET /livez http/1.1"), {400}, kCloses},
      {"a version with two digits", Head("GET /livez HTTP/1.10"), {400}, kCloses},
      {"NUL in the target", Head("GET /li\0vez HTTP/1.1"s), {400}, kCloses},
      {"a control character in the target", Head("GET /li\x01vez HTTP/1.1"), {400}, kCloses},
      {"percent-encoding is undone", Head("GET /ma%75i/layer.json HTTP/1.1"), {200}},
      {"broken percent-encoding", Head("GET /maui%2/layer.json HTTP/1.1"), {400}},
      {"percent-encoded NUL", Head("GET /maui%00/layer.json HTTP/1.1"), {400}},
      {"percent-encoded line breaks", Head("GET /livez?v=%0d%0aA:b HTTP/1.1"), {400}},
      {"dot segments are not followed", Head("GET /viewer/../livez HTTP/1.1"), {404}},
      {"encoded dot segments are not followed", Head("GET /viewer/%2e%2e/livez HTTP/1.1"), {404}},
      {"empty segments count", Head("GET //livez HTTP/1.1"), {404}},
      {"the longest target", Head("GET /" + std::string(8191, 'a') + " HTTP/1.1"), {404}},
      {"a target too long", Head("GET /" + std::string(8192, 'a') + " HTTP/1.1"), {414}, kCloses},
      {"bare LF", "GET /livez HTTP/1.1\nHost: x\n\n", {400}, kCloses},
      {"bare CR", "GET /livez HTTP/1.1\rHost: x\r\n\r\n", {400}, kCloses},
  };
}

std::vector<Rule> Hosts() {
  return {
      {"none", Head("GET /livez HTTP/1.1", ""), {400}, kCloses},
      {"two", Head("GET /livez HTTP/1.1", "Host: x\r\nHost: x\r\n"), {400}, kCloses},
      {"empty", Head("GET /livez HTTP/1.1", "Host:\r\n"), {200}},
      {"with a port", Head("GET /livez HTTP/1.1", "Host: x:8080\r\n"), {200}},
      {"IPv6", Head("GET /livez HTTP/1.1", "Host: [::1]:8080\r\n"), {200}},
      {"with a blank", Head("GET /livez HTTP/1.1", "Host: x y\r\n"), {400}, kCloses},
      {"with a path", Head("GET /livez HTTP/1.1", "Host: x/y\r\n"), {400}, kCloses},
      {"with a user", Head("GET /livez HTTP/1.1", "Host: u@x\r\n"), {400}, kCloses},
      {"a list", Head("GET /livez HTTP/1.1", "Host: x, y\r\n"), {400}, kCloses},
      {"HTTP/1.0 needs none", Head("GET /livez HTTP/1.0", ""), {200}, kCloses},
  };
}

std::vector<Rule> Fields() {
  std::string hundred, thousands;
  for (int i = 0; i < 100; ++i) hundred += "A" + std::to_string(i) + ": b\r\n";
  for (int i = 0; i < 5'000; ++i) thousands += "A: b\r\n";
  const std::size_t rest = With("A: \r\n").size();
  return {
      {"names have no case", Head("GET /livez HTTP/1.1", "hOST: x\r\n"), {200}},
      {"no blank after the colon", Head("GET /livez HTTP/1.1", "Host:x\r\n"), {200}},
      {"blanks around a value", With("A: \t b \t \r\n"), {200}},
      {"an empty value", With("A:\r\n"), {200}},
      {"a tab in a value", With("A: b\tc\r\n"), {200}},
      {"bytes above ASCII in a value", With("A: \xe9\xff\r\n"), {200}},
      {"a field twice", With("A: b\r\nA: c\r\n"), {200}},
      {"a hundred fields", With(hundred), {200}},
      {"thousands of fields", With(thousands), {431}, kCloses},
      {"the largest head", With("A: " + std::string(16 * 1024 - rest, 'b') + "\r\n"), {200}},
      {"a head too large", With("A: " + std::string(16 * 1024 - rest + 1, 'b') + "\r\n"), {431}, kCloses},
      {"a blank before the colon", With("A : b\r\n"), {400}, kCloses},
      {"a folded line", With("A: b\r\n c\r\n"), {400}, kCloses},
      {"a blank before the first field", Head("GET /livez HTTP/1.1", " Host: x\r\n"), {400}, kCloses},
      {"no name", With(": b\r\n"), {400}, kCloses},
      {"no colon", With("nonsense\r\n"), {400}, kCloses},
      {"a name that is no token", With("A(b): c\r\n"), {400}, kCloses},
      {"a name above ASCII", With("\xe9: c\r\n"), {400}, kCloses},
      {"CR in a value", With("A: b\rc\r\n"), {400}, kCloses},
      {"LF ends a line", With("A: b\nC: d\r\n"), {400}, kCloses},
      {"NUL in a value", With("A: b\0c\r\n"s), {400}, kCloses},
      {"a control character in a value", With("A: b\x7f\r\n"), {400}, kCloses},
  };
}

std::vector<Rule> Bodies() {
  const std::string next = With("");
  return {
      {"a length of nothing", With("Content-Length: 0\r\n") + next, {200, 200}},
      {"a body nobody asked for", With("Content-Length: 5\r\n") + "hello", {400}, kCloses},
      {"chunked, with a method without a body", With("Transfer-Encoding: chunked\r\n") + "0\r\n\r\n", {400}, kCloses},
      {"a length that is no number", With("Content-Length: five\r\n"), {400}, kCloses},
      {"a negative length", With("Content-Length: -1\r\n"), {400}, kCloses},
      {"two lengths", With("Content-Length: 0\r\nContent-Length: 0\r\n"), {400}, kCloses},
      {"a list of lengths", With("Content-Length: 0, 0\r\n"), {400}, kCloses},
      {"a body by its length", PostOf("", kBody) + next, {200, 200}},
      {"two bodies", PostOf("", kBody) + PostOf("", kBody), {200, 200}},
      {"no length is no body",
       "POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Type: application/json\r\n\r\n",
       {400}},
      {"chunked bodies are not read",
       Head("POST /maui/heights HTTP/1.1", "Host: x\r\nTransfer-Encoding: chunked\r\n"),
       {400},
       kCloses},
      {"a body too large",
       Head("POST /maui/heights HTTP/1.1", "Host: x\r\nContent-Length: 99999999\r\n"),
       {413},
       kCloses},
      {"a body in a coding", PostOf("Content-Encoding: gzip\r\n", kBody), {415}, kCloses},
      {"a body in the coding that is none", PostOf("Content-Encoding: identity\r\n", kBody), {200}},
      {"a coding of no body", With("Content-Encoding: gzip\r\n") + next, {200, 200}},
      {"a body of another type",
       "POST /maui/heights HTTP/1.1\r\nHost: x\r\nContent-Type: text/plain\r\nContent-Length: 2\r\n\r\nhi",
       {415}},
      {"a POST where there is none",
       Head("POST /livez HTTP/1.1", "Host: x\r\nContent-Length: 2\r\n") + "hi",
       {405},
       kCloses},
      {"an expectation that is not met",
       Head("POST /maui/heights HTTP/1.1", "Host: x\r\nExpect: 100-continue\r\nContent-Length: 99999999\r\n"),
       {413},
       kCloses},
      {"no interim reply to HTTP/1.0", PostOf("Expect: 100-continue\r\n", kBody, "1.0"), {200}, kCloses},
  };
}

std::vector<Rule> Connections() {
  const std::string get = With("");
  return {
      {"stay open", get + get + get, {200, 200, 200}},
      {"close", With("Connection: close\r\n") + get, {200}, kCloses},
      {"close, whatever its case", With("Connection: CLOSE\r\n"), {200}, kCloses},
      {"close among others", With("Connection: keep-alive, close\r\n"), {200}, kCloses},
      {"close in a second field", With("Connection: keep-alive\r\nConnection: close\r\n") + get, {200}, kCloses},
      {"HTTP/1.0 stays where a second field asks to",
       Head("GET /livez HTTP/1.0", "Connection: TE\r\nConnection: keep-alive\r\n") + get,
       {200, 200}},
      {"HTTP/1.0 closes", Head("GET /livez HTTP/1.0") + get, {200}, kCloses},
      {"HTTP/1.0 stays where asked to", Head("GET /livez HTTP/1.0", "Connection: keep-alive\r\n") + get, {200, 200}},
      {"an upgrade is not taken",
       With("Connection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\nHTTP2-Settings: AA\r\n"),
       {200}},
      {"errors of the URL keep it open", Head("GET /nope HTTP/1.1") + get, {404, 200}},
  };
}

std::vector<Rule> Conditions() {
  const std::string tile = "GET /maui/layer.json HTTP/1.1";
  return {
      {"any", Head(tile, "Host: x\r\nIf-None-Match: *\r\n"), {304}},
      {"another", Head(tile, "Host: x\r\nIf-None-Match: \"other\"\r\n"), {200}},
      {"malformed", Head(tile, "Host: x\r\nIf-None-Match: other\r\n"), {200}},
      {"dates are not compared", Head(tile, "Host: x\r\nIf-Modified-Since: Sat, 01 Jan 2050 00:00:00 GMT\r\n"), {200}},
      {"ranges are not served", Head(tile, "Host: x\r\nRange: bytes=0-1\r\n"), {200}},
      {"unknown codings", Head(tile, "Host: x\r\nAccept-Encoding: br;q=1, zz, identity;q=0.5\r\n"), {200}},
      {"no coding that suits", Head(tile, "Host: x\r\nAccept-Encoding: identity;q=0, *;q=0\r\n"), {200}},
      {"no type that suits", Head(tile, "Host: x\r\nAccept: text/xml\r\n"), {200}},
      {"TE and Trailer of a request without a body", Head(tile, "Host: x\r\nTE: trailers\r\nTrailer: A\r\n"), {200}},
  };
}

class HttpRules : public ServerFixture {
 protected:
  HttpRules() {
    read_points_ = [](std::uint32_t, std::span<const dem::GeoPosition> points, dem::HeightDatum, std::stop_token) {
      return Result<std::vector<float>>(std::vector<float>(points.size(), 1.0f));
    };
  }

  void Check(const Rule& rule) {
    SCOPED_TRACE(rule.says);
    RawClient client(port());
    client.Send(rule.sent);
    for (const int status : rule.statuses) {
      const auto reply = client.Read();
      ASSERT_TRUE(reply) << rule.sent.substr(0, 100);
      EXPECT_EQ(reply->status, status) << rule.sent.substr(0, 100) << "\n" << reply->body;
      CheckReply(*reply);
    }
    if (!rule.stays_open) {
      EXPECT_TRUE(client.Ended());
      return;
    }
    client.Send(With(""));
    const auto next = client.Read();
    ASSERT_TRUE(next) << "closed, or took more than was sent";
    EXPECT_EQ(next->body, "ok\n");
  }

  // Checks that hold for every reply.
  static void CheckReply(const Reply& reply) {
    static const std::regex date("[A-Z][a-z]{2}, [0-9]{2} [A-Z][a-z]{2} [0-9]{4} [0-9]{2}:[0-9]{2}:[0-9]{2} GMT");
    EXPECT_TRUE(std::regex_match(reply.Field("date"), date)) << reply.Field("date");
    const bool has_length = reply.fields.contains("content-length");
    EXPECT_EQ(has_length, reply.status != 204 && reply.status != 304);
    // An HTTP/1.1 reply without a Connection field keeps the connection open.
    EXPECT_TRUE(!reply.fields.contains("connection") || reply.Field("connection") == "close" ||
                reply.Field("connection") == "keep-alive");
    EXPECT_EQ(reply.fields.contains("allow"), reply.status == 405 || reply.status == 204);
    EXPECT_EQ(reply.fields.contains("accept-encoding"), reply.status == 415 && reply.Field("connection") == "close");
    if (reply.status >= 400) {
      EXPECT_EQ(reply.Field("content-type"), "application/problem+json");
    }
  }

  ServerOptions options_;
};

TEST_F(HttpRules, AreKept) {
  Start(options_);
  int cases = 0;
  for (const auto& table : {RequestLines(), Hosts(), Fields(), Bodies(), Connections(), Conditions()}) {
    for (const Rule& rule : table) Check(rule);
    cases += static_cast<int>(table.size());
  }
  EXPECT_GE(cases, 80);
  RecordProperty("cases", cases);
}

TEST_F(HttpRules, HeadIsGetWithoutItsBody) {
  Start(options_);
  for (const std::string target : {"/livez", "/maui/layer.json", "/maui/0/0/0.terrain", "/nope"}) {
    RawClient client(port());
    client.Send("GET " + target + " HTTP/1.1\r\nHost: x\r\n\r\nHEAD " + target + " HTTP/1.1\r\nHost: x\r\n\r\n" +
                With(""));
    const auto get = client.Read(), head = client.Read(/*head=*/true), next = client.Read();
    ASSERT_TRUE(get && head && next) << target;
    for (const char* field : {"content-length", "content-type", "etag", "vary", "cache-control"}) {
      EXPECT_EQ(head->Field(field), get->Field(field)) << target << ' ' << field;
    }
    EXPECT_EQ(next->body, "ok\n") << "a body followed the reply to HEAD";
  }
}

}  // namespace
}  // namespace terrace::server
