#include "config/json_text.h"

#include <gtest/gtest.h>

#include "tests/config/errors.h"

namespace terrace::config {
namespace {

using testing::ElementsAre;

TEST(ParseJsonText, TellsLineAndColumnOfASyntaxError) {
  EXPECT_THAT(ErrorsOf("{\n  \"listen\": \"a:1\",\n  \"viewer\": tru\n}"),
              ElementsAre(IsError("", "line 3, column 16: syntax error")));
  EXPECT_THAT(ErrorsOf("{\"listen\" 1}"), ElementsAre(IsError("", "line 1, column 11: syntax error")));
}

TEST(ParseJsonText, TellsWhereATextStopsTooEarly) {
  EXPECT_THAT(ErrorsOf(""), ElementsAre(IsError("", "line 1, column 1: syntax error")));
  EXPECT_THAT(ErrorsOf("{\n\"datasets\": ["), ElementsAre(IsError("", "line 2, column 14: syntax error")));
}

TEST(ParseJsonText, ReportsNothingButTheSyntaxErrorAndEarlierDuplicates) {
  EXPECT_THAT(ErrorsOf(R"({"io_threads": 0, "listen": )"), ElementsAre(IsError("", "syntax error")));
}

TEST(ParseJsonText, RefusesCommentsAndTextAfterTheEnd) {
  EXPECT_THAT(ErrorsOf("{} // done"), ElementsAre(IsError("", "line 1, column 4")));
  EXPECT_THAT(ErrorsOf("{}{}"), ElementsAre(IsError("", "line 1, column 3")));
}

TEST(ParseJsonText, SaysWhatItMostLikelyIs) {
  EXPECT_THAT(ErrorsOf(R"({"sources": ["a.tif", "b.tif", ] })"), ElementsAre(IsError("", "no comma before it")));
  EXPECT_THAT(ErrorsOf("{\"viewer\": true,\n}"), ElementsAre(IsError("", "line 2, column 1: syntax error")));
  EXPECT_THAT(ErrorsOf("{\"viewer\": true,\n}"), ElementsAre(IsError("", "no comma before it")));
  EXPECT_THAT(ErrorsOf("{\n# the viewer\n\"viewer\": true}"), ElementsAre(IsError("", "JSON has no comments")));
  EXPECT_THAT(ErrorsOf(std::string("II*\0\b\0", 6)), ElementsAre(IsError("", "a DEM is served without --config")));
}

TEST(ParseJsonText, RefusesNumbersThatNoDoubleHolds) {
  std::vector<ConfigError> errors;
  EXPECT_TRUE(ParseJsonText("[1e999]", errors).is_discarded());
  EXPECT_THAT(errors, ElementsAre(IsError("", "number overflow parsing '1e999'")));
  EXPECT_EQ(errors.at(0).message.find("json.exception"), std::string::npos) << errors.at(0).message;
}

TEST(ParseJsonText, ReportsKeysThatAppearTwiceWithTheirPlace) {
  EXPECT_THAT(ErrorsOf(R"({"listen": "a:1", "listen": "b:2"})"), ElementsAre(IsError("/listen", "appears twice")));
  EXPECT_THAT(
      ErrorsOf(
          R"({"datasets": [{"name": "a", "sources": ["a.tif"]}, {"name": "b", "sources": ["b.tif"], "name": "c"}]})"),
      ElementsAre(IsError("/datasets/1/name", "appears twice")));
}

TEST(ParseJsonText, AllowsOneKeyInTwoObjects) {
  std::vector<ConfigError> errors;
  ParseJsonText(R"([{"a": {"a": 1}}, {"a": [{"a": 2}, {"a": 3}]}])", errors);
  EXPECT_TRUE(errors.empty());
}

TEST(Quote, CutsLongValuesAndKeepsThemOnOneLine) {
  EXPECT_EQ(Quote(Json("a\nb")), R"("a\nb")");
  EXPECT_EQ(Quote(Json("\xff")).find('\xff'), std::string::npos);
  const std::string quoted = Quote(Json(std::string(500, 'x')));
  EXPECT_EQ(quoted.size(), 63u);
  EXPECT_TRUE(quoted.ends_with("..."));
}

}  // namespace
}  // namespace terrace::config
