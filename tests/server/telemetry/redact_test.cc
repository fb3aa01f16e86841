#include "server/telemetry/redact.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <string>

#include "tests/support/source_dir.h"

namespace terrace::server {
namespace {

TEST(RedactTarget, ShowsPlainTargetsWhole) {
  for (const char* target :
       {"/", "/maui/0/0/0.terrain", "/maui/3dtiles/9-272-359/2/1/0.7.subtree", "/maui/layer.json?error=5&atleast=1",
        "/maui/heights?locations=36.3,-84.2|1e1,2", "/maui/heights?locations=36.3%2C-84.2%7C1,2&datum=orthometric",
        "/maui/0/0/0.terrain?extensions=octvertexnormals-watermask", "/maui/mesh?bbox=-1,2,+3,4.5&error=1&format=obj",
        "/maui/tileset.json?compression=meshopt&texture=webp", "/viewer/Workers/createTaskProcessorWorker.js",
        "/maui/layer.json?error=&fraction", "/maui/grid?crs=EPSG:32632&spacing=10",
        "/maui/grid?crs=epsg%3A4326&width=2", "/maui/heights?locations=36.3,%20-84.2%7C1,%202"}) {
    EXPECT_TRUE(IsPlainTarget(target)) << target;
    EXPECT_EQ(RedactTarget(target, true), target);
  }
  EXPECT_TRUE(IsPlainTarget("/maui/0/0/0.terrain?v=1.0.0-a_b"));
  EXPECT_EQ(RedactTarget("/maui/0/0/0.terrain?v=1.0.0&error=5", true), "/maui/0/0/0.terrain?v&error=5");
}

TEST(RedactTarget, LeavesOutWhatMayBeASecret) {
  const struct {
    const char *target, *shown;
  } cases[] = {
      {"/maui/layer.json?Token=s", "/maui/layer.json?+1"},
      {"/maui/layer.json?%54oken=s&error=5&token%3Ds&%2574oken=s", "/maui/layer.json?error=5&+3"},
      {"/maui/layer.json?token=s&error=5&token", "/maui/layer.json?error=5"},
      {"/maui/layer.json?error=5;token=s", "/maui/layer.json?+1"},
      {"/maui/layer.json?v=1;token=s", "/maui/layer.json?+1"},
      {"/maui/layer.json?extensions=metadata-s", "/maui/layer.json?+1"},
      {"/maui/layer.json?error=s&&error=%35", "/maui/layer.json?+2"},
      {"/maui/grid?crs=EPSG:s&crs=EPSG:0123456&crs=s:1&spacing=EPSG:1", "/maui/grid?+4"},
      {"/maui/layer.json;token=s?error=5", "/maui/layer.json...?error=5"},
      {"/maui/layer.json%3Ftoken=s", "/maui/layer.json..."},
      {"/maui/layer.json#token=s", "/maui/layer.json..."},
      {"http://user:s@host:80/maui/layer.json?s", "/maui/layer.json?+1"},
      {"HTTPS://s?s", "?+1"},
      {"maui?s", "..."},
      {"s:443", "..."},
      {"", ""},
  };
  for (const auto& c : cases) {
    EXPECT_EQ(RedactTarget(c.target, true), c.shown);
    EXPECT_FALSE(IsPlainTarget(c.target)) << c.target;
  }
  EXPECT_EQ(RedactTarget("*", false), "*");
}

TEST(RedactTarget, CutsPartsOfUnknownPathsThatAreAsLongAsAToken) {
  EXPECT_EQ(RedactTarget("/token/0123456789abcdef/maui/layer.json", false), "/token/.../maui/layer.json");
  EXPECT_EQ(RedactTarget("/0123456789abcdef;x", false), "/...");
  EXPECT_EQ(RedactTarget("/favicon.ico", false), "/favicon.ico");
}

TEST(RedactReferer, IsAPageWithoutSecrets) {
  EXPECT_EQ(RedactReferer("https://maps.example/globe?token=s#s"), "https://maps.example/globe");
  EXPECT_EQ(RedactReferer("http://user:s@maps.example:80/a;s"), "http://maps.example:80/a...");
  EXPECT_EQ(RedactReferer("https://maps.example/share/0123456789abcdef/a"), "https://maps.example/share/.../a");
  EXPECT_EQ(RedactReferer("s"), "");
}

// If a parameter is missing from the list, its replies are not in shared caches.
TEST(IsPlainTarget, KnowsTheParametersOfTheManual) {
  std::ifstream file(test_support::SourceDir() / "docs/http-api.md");
  const std::string manual{std::istreambuf_iterator<char>(file), {}};
  const std::regex parameter("`[?]?([a-z]+)=([a-z0-9]*)");
  int count = 0;
  for (std::sregex_iterator at(manual.begin(), manual.end(), parameter), end; at != end; ++at) {
    if ((*at)[1] == "token") continue;
    ++count;
    const std::string query = (*at)[1].str() + "=" + (*at)[2].str();
    EXPECT_TRUE(IsPlainTarget("/maui/x?" + query)) << query;
  }
  EXPECT_GE(count, 20);
}

}  // namespace
}  // namespace terrace::server
