#include "fly/http/url.h"

#include <gtest/gtest.h>

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

TEST(Url, IsResolvedAgainstADocument) {
  const Url base = *ParseUrl("http://h:8080/a/b/layer.json?error=5");
  EXPECT_EQ(Resolve(base, "1/2/3.terrain?v=1")->target, "/a/b/1/2/3.terrain?v=1");
  EXPECT_EQ(Resolve(base, "/x")->target, "/x");
  EXPECT_EQ(Resolve(base, "../x")->target, "/a/x");
  EXPECT_EQ(Resolve(base, "./x")->target, "/a/b/x");
  EXPECT_EQ(Resolve(base, "https://cdn/x")->Text(), "https://cdn/x");
}

}  // namespace
}  // namespace terrace::fly
