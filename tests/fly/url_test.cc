#include "fly/http/url.h"

#include <gtest/gtest.h>

#include <string>

namespace terrace::fly {
namespace {

TEST(Url, IsReadAndWritten) {
  for (const char* text :
       {"http://127.0.0.1:8080/maui/layer.json?error=5", "https://tiles.example.org/a", "http://[::1]:80/"}) {
    const Result<Url> url = ParseUrl(text);
    ASSERT_TRUE(url) << text;
    EXPECT_EQ(ParseUrl(url->Text())->target, url->target);
  }
  EXPECT_EQ(ParseUrl("https://a")->origin.port, "443");
  EXPECT_EQ(ParseUrl("http://[::1]:8080/x#y")->origin.host, "::1");
  EXPECT_EQ(ParseUrl("http://[::1]:8080/x#y")->target, "/x");
  for (const char* text :
       {"maui", "ftp://a/", "http://", "http://a:b/", "http://user:x@a/", "http://a/b c", "http://[::1/"}) {
    EXPECT_FALSE(ParseUrl(text)) << text;
  }
}

TEST(Url, HasAPortFrom1To65535) {
  EXPECT_EQ(ParseUrl("http://a:1/")->origin.port, "1");
  EXPECT_EQ(ParseUrl("http://a:65535/")->origin.port, "65535");
  EXPECT_EQ(ParseUrl("https://a:0443/")->Text(), "https://a/");
  EXPECT_EQ(ParseUrl("http://a:/")->origin.port, "80");  // RFC 3986 allows it
  for (const char* port : {"0", "65536", "74236", "-1", "+1", "8080x", " 80", "18446744073709551617"}) {
    for (const std::string host : {"a", "[::1]"}) {
      const Result<Url> url = ParseUrl("http://" + host + ":" + port + "/maui");
      ASSERT_FALSE(url) << port;
      const std::string& message = url.error().message;
      EXPECT_NE(message.find(std::string("the port ") + port + " is no number from 1 to 65535; give a URL"),
                std::string::npos)
          << message;
    }
  }
}

TEST(Url, HasAColonInTheHostOnlyInBrackets) {
  for (const char* text : {"http://h:8700:1/x", "http://::1/x", "http://::1:8080/x"}) {
    const Result<Url> url = ParseUrl(text);
    ASSERT_FALSE(url) << text;
    EXPECT_NE(url.error().message.find("in brackets"), std::string::npos) << url.error().message;
  }
  EXPECT_FALSE(ParseUrl("http://[::1]x:80/"));
}

TEST(Url, IsShownWithoutSecrets) {
  const auto shown = [](const char* text) { return ParseUrl(text)->PublicText(); };
  for (const char* plain :
       {"http://h/a", "http://h/a?error=5", "http://h/a?token=0123456789abcde&error=5&x", "http://h/?"}) {
    EXPECT_EQ(shown(plain), plain);
  }
  EXPECT_EQ(shown("http://h/a?token=0123456789abcdef"), "http://h/a?token=...");
  EXPECT_EQ(shown("http://h/a?error=5&token=0123456789abcdef&v=2"), "http://h/a?error=5&token=...&v=2");
  EXPECT_EQ(shown("http://h/a?token=0123456789abcdef=="), "http://h/a?token=...");
  for (const char* wrong :
       {"http://[::1/a?token=0123456789abcdef", "http://h:0?token=0123456789abcdef", "h?t=0123456789abcdef"}) {
    const std::string message = ParseUrl(wrong).error().message;
    EXPECT_EQ(message.find("0123456789abcdef"), std::string::npos) << message;
    EXPECT_TRUE(message.starts_with(std::string(wrong).substr(0, std::string(wrong).find('?') + 1))) << message;
  }
}

TEST(Url, IsResolvedAgainstADocument) {
  const Url base = *ParseUrl("http://h:8080/a/b/layer.json?error=5");
  EXPECT_EQ(Resolve(base, "1/2/3.terrain?v=1")->target, "/a/b/1/2/3.terrain?v=1");
  EXPECT_EQ(Resolve(base, "/x")->target, "/x");
  EXPECT_EQ(Resolve(base, "../x")->target, "/a/x");
  EXPECT_EQ(Resolve(base, "./x")->target, "/a/b/x");
  EXPECT_EQ(Resolve(base, "https://cdn/x")->Text(), "https://cdn/x");
}

TEST(Url, OfATileHasTheDocumentsParametersThatItLacks) {
  const Url base = *ParseUrl("http://h/a/layer.json?error=5&token=t&&flag");
  const auto resolved = [&base](const char* reference) { return ResolveWithQuery(base, reference)->Text(); };
  EXPECT_EQ(resolved("1/2.terrain"), "http://h/a/1/2.terrain?error=5&token=t&flag");
  EXPECT_EQ(resolved("2.glb?v=1&error=9"), "http://h/a/2.glb?v=1&error=9&token=t&flag");
  EXPECT_EQ(resolved("http://h:80/x?errors=1"), "http://h/x?errors=1&error=5&token=t&flag");
  for (const char* elsewhere : {"https://h/x", "http://h:81/x?v=1", "//cdn/x"}) {
    EXPECT_EQ(ResolveWithQuery(base, elsewhere)->target, Resolve(base, elsewhere)->target);
  }
  EXPECT_EQ(ResolveWithQuery(*ParseUrl("http://h/a"), "b?v=1")->target, "/b?v=1");
  EXPECT_FALSE(ResolveWithQuery(base, "http://[::1/"));
}

}  // namespace
}  // namespace terrace::fly
