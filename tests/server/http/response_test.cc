#include "server/http/response.h"

#include <gtest/gtest.h>

#include "server/http/http_error.h"

namespace terrace::server {
namespace {

TEST(Response, SpeaksTheVersionOfTheRequest) {
  EXPECT_TRUE(SerializeHead(Response(), {.version = 10, .keep_alive = true}).starts_with("HTTP/1.0 200 OK\r\n"));
  EXPECT_TRUE(SerializeHead(Response(), {.keep_alive = true}).starts_with("HTTP/1.1 200 OK\r\n"));
  const auto connection = [](unsigned version, bool keep_alive) {
    const std::string head = SerializeHead(Response(), {.version = version, .keep_alive = keep_alive});
    const std::size_t at = head.find("\r\nConnection: ");
    return at == std::string::npos ? "" : head.substr(at + 14, head.find("\r\n", at + 2) - at - 14);
  };
  EXPECT_EQ(connection(10, true), "keep-alive");
  EXPECT_EQ(connection(11, true), "") << "it is what HTTP/1.1 means";
  EXPECT_EQ(connection(10, false), "close");
  EXPECT_EQ(connection(11, false), "close");
}

TEST(Response, CarriesCorsAndALength) {
  Response response;
  response.content_type = "text/plain";
  response.body = std::make_shared<const std::string>("hello");
  response.content_encoding = "gzip";
  response.etag = "\"e\"";
  response.vary = "Accept, Accept-Encoding";
  const std::string head = SerializeHead(response, {});
  for (const char* line :
       {"\r\nContent-Length: 5\r\n", "\r\nContent-Encoding: gzip\r\n", "\r\nETag: \"e\"\r\n",
        "\r\nVary: Accept, Accept-Encoding\r\n", "\r\nAccess-Control-Allow-Origin: *\r\n",
        "\r\nAccess-Control-Expose-Headers: ETag, Terrain-Max-Error, Terrain-Certified-Error, Terrain-Origin, "
        "Terrain-Grid, Retry-After, Server-Timing\r\n",
        "\r\nTiming-Allow-Origin: *\r\n", "\r\nConnection: close\r\n", "\r\nDate: "}) {
    EXPECT_NE(head.find(line), std::string::npos) << line;
  }
  EXPECT_TRUE(head.ends_with("\r\n\r\n"));
}

TEST(Response, HasNoBodyHeadersWithoutABody) {
  Response response;
  response.status = 304;
  response.content_type = "text/plain";
  response.content_encoding = "gzip";
  const std::string head = SerializeHead(response, {.keep_alive = true});
  EXPECT_EQ(head.find("\r\nContent-"), std::string::npos) << head;
}

TEST(Response, SendsLinesThatWereMadeBeforehand) {
  Response response;
  response.lines = std::make_shared<const std::string>("Content-Length: 5\r\nETag: \"e\"\r\n");
  response.bytes_about_body = 19;
  EXPECT_NE(SerializeHead(response, {}).find("\r\nContent-Length: 5\r\nETag: \"e\"\r\n"), std::string::npos);
  response.status = 304;
  const std::string head = SerializeHead(response, {});
  EXPECT_EQ(head.find("Content-Length"), std::string::npos) << head;
  EXPECT_NE(head.find("\r\nETag: \"e\"\r\n"), std::string::npos) << head;
}

TEST(Response, MatchesEtagsAsListsWeakAndStar) {
  const struct {
    const char* if_none_match;
    bool matches;
  } cases[] = {
      {"", false},
      {"*", true},
      {" * ", true},
      {"\"a\"", true},
      {"W/\"a\"", true},
      {"\"b\"", false},
      {"\"b\", \"a\"", true},
      {"\"b\",W/\"a\" , \"c\"", true},
      {"\"b\",, \"a\"", true},
      {"a", false},
      {"\"a", false},
      {"\"b\" \"a\"", false},
      {"\"a,b\"", false},
      {"\"*\"", false},
  };
  EXPECT_TRUE(MatchesEtag(" ,, \"a\"", "\"a\"")) << "empty elements";
  for (const auto& c : cases) EXPECT_EQ(MatchesEtag(c.if_none_match, "\"a\""), c.matches) << c.if_none_match;
  EXPECT_FALSE(MatchesEtag("*", "")) << "a reply without one";
}

TEST(Response, IsForItsReaderAloneWhereATokenDecides) {
  Response response;
  response.cache_control = "public, max-age=3600, s-maxage=9";
  response.vary = "Accept, Accept-Encoding";
  response.depends_on_token = true;
  const std::string head = SerializeHead(response, {});
  EXPECT_NE(head.find("\r\nCache-Control: private, max-age=3600\r\n"), std::string::npos) << head;
  EXPECT_NE(head.find("\r\nVary: Accept, Accept-Encoding, Authorization\r\n"), std::string::npos) << head;
  EXPECT_EQ(PrivateCacheControl("no-cache"), "private, no-cache");
  EXPECT_EQ(PrivateCacheControl("private"), "private");
}

TEST(Response, BecomesNotModifiedOnlyFromSuccess) {
  Request request;
  request.fields.Set(&RequestFields::if_none_match, "*");
  Response good;
  good.etag = "\"a\"";
  good.body = std::make_shared<const std::string>("x");
  const Response unchanged = Conditional(good, request);
  EXPECT_EQ(unchanged.status, 304);
  EXPECT_EQ(unchanged.body, nullptr);
  EXPECT_EQ(unchanged.etag, "\"a\"");
  EXPECT_EQ(Conditional(ProblemResponse(404, "x", "id"), request).status, 404);
}

TEST(HttpError, NeverAnswersFiveHundred) {
  EXPECT_EQ(StatusOf(ErrorCode::kInvalidArgument), 400);
  EXPECT_EQ(StatusOf(ErrorCode::kNotFound), 404);
  for (const ErrorCode code : {ErrorCode::kUnavailable, ErrorCode::kChanged, ErrorCode::kOverloaded,
                               ErrorCode::kCancelled, ErrorCode::kInternal}) {
    EXPECT_EQ(StatusOf(code), 503);
  }
}

TEST(HttpError, WritesAProblemAsJson) {
  EXPECT_EQ(
      *ProblemResponse(404, "no \"such\" \\ thing\n", "id7").body,
      R"({"type":"about:blank","title":"Not found","status":404,"detail":"no \"such\" \\ thing\u000a","request_id":"id7"})");
}

TEST(HttpError, KeepsTheDetailFromTheClient) {
  const Response response = BackendErrorResponse(Error{ErrorCode::kUnavailable, "/secret/maui.tif: gone"}, "id7");
  EXPECT_EQ(response.status, 503);
  EXPECT_EQ(response.body->find("secret"), std::string::npos);
  EXPECT_NE(response.body->find("\"request_id\":\"id7\""), std::string::npos);
  EXPECT_EQ(response.content_type, "application/problem+json");
  EXPECT_EQ(response.content_encoding, "");
  EXPECT_NE(SerializeHead(response, {.keep_alive = true}).find("\r\nRetry-After: 5\r\n"), std::string::npos);
}

// An image that is too large is not an error of the client that requests a tile of it.
TEST(Response, FailuresBehindAreNeverTheClients) {
  const Response response = BackendErrorResponse(Error{ErrorCode::kInvalidArgument, "too many pixels"}, "id8");
  EXPECT_EQ(response.status, 503);
  EXPECT_EQ(response.body->find("cannot be understood"), std::string::npos) << *response.body;
}

}  // namespace
}  // namespace terrace::server
