#include "config/input/json_text.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

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

// This takes minutes if the parser searches for each object in its list.
TEST(ParseJsonText, TakesALongListOfObjects) {
  constexpr std::size_t kCount = 400'000;
  std::string text = "{\"datasets\": [{}";
  for (std::size_t i = 1; i < kCount; ++i) text += ",{}";
  text += "], \"a\": {\"b\": [1, {\"c\": 1, \"c\": 2}]}}";
  std::vector<ConfigError> errors;
  const Json value = ParseJsonText(text, errors);
  EXPECT_EQ(value["datasets"].size(), kCount);
  EXPECT_THAT(errors, ElementsAre(IsError("", "the key that ends here stands twice")));
}

// The parser compares each key with all keys before it.
TEST(ParseJsonText, RefusesAnObjectOfManyKeys) {
  std::string text = "{\"0\": 0";
  for (int i = 1; i < 1000; ++i) text += ",\n\"" + std::to_string(i) + "\": 0";
  std::vector<ConfigError> errors;
  EXPECT_EQ(ParseJsonText(text + "}", errors).size(), 1000u);
  EXPECT_THAT(errors, testing::IsEmpty());
  EXPECT_TRUE(ParseJsonText(text + ",\n\"more\": 0}", errors).is_discarded());
  EXPECT_THAT(errors, ElementsAre(IsError("", "line 1001, column 6: more than 1000 keys in one object")));
}

TEST(ParseJsonText, RefusesADeepText) {
  std::string text;
  for (int i = 0; i < 50; ++i) text += "{\"a\":[";
  std::vector<ConfigError> errors;
  EXPECT_TRUE(ParseJsonText(text + "[", errors).is_discarded());
  EXPECT_TRUE(ParseJsonText(text + "{", errors).is_discarded());
  EXPECT_THAT(errors, ElementsAre(IsError("", "line 1, column 301: lists or objects nested more than 100 deep"),
                                  IsError("", "line 1, column 301: lists or objects nested more than 100 deep")));
  std::string end;
  for (int i = 0; i < 50; ++i) end += "]}";
  EXPECT_FALSE(ParseJsonText(text + end, errors).is_discarded());
}

TEST(ParseJsonText, QuotesNothingOfTheText) {
  for (const char* text : {"{\"token\": s3cret}", "{\"token\": \"s3cret\n\"}", "{\"token\": \"s3cret", "{\"s3cret\" 1}",
                           "{\"token\": \"s3cret\\x\"}", "{} s3cret", "{\"token\": 1e9999}", "\"s3cret"}) {
    for (const ConfigError& error : ErrorsOf(text)) {
      EXPECT_EQ(error.message.find("s3c"), std::string::npos) << text << ": " << error.message;
      EXPECT_EQ(error.message.find("9999"), std::string::npos) << text << ": " << error.message;
    }
    EXPECT_FALSE(ErrorsOf(text).empty()) << text;
  }
}

TEST(ParseJsonText, RefusesCommentsAndTextAfterTheEnd) {
  EXPECT_THAT(ErrorsOf("{} // done"), ElementsAre(IsError("", "line 1, column 4")));
  EXPECT_THAT(ErrorsOf("{}{}"), ElementsAre(IsError("", "line 1, column 3")));
}

TEST(ParseJsonText, SaysWhatItMostLikelyIs) {
  const std::string comma = "take away the comma", comment = "JSON has no comments", dem = "served without --config";
  const std::string utf16 = "save it as UTF-8";
  const std::vector<std::pair<std::string, std::string>> cases = {
      {R"({"sources": ["a.tif", "b.tif", ] })", comma},
      {"{\"viewer\": true,\n}", comma},
      {"{\n# the viewer\n\"viewer\": true}", comment},
      {"// a configuration\n{}", comment},
      {"{\"viewer\": true /* or false */}", comment},
      {std::string("II*\0\b\0", 6), dem},
      {"ncols 40\nnrows 30\n", dem},
      {std::string("\xFF\xFE{\0}\0", 6), utf16},
      {std::string("{\0}\0", 4), utf16},
      {"{\"viewer\": tru}", ""},
      {"{\"viewer\" true, \"listen\": 1}", ""},
      {R"({"a": "C:\#x"})", ""},
      {"{\"a\": \"caf\xE9//1\"}", ""},
      {"\xEF\xBB\xBF {\"viewer\": }", ""},
      {std::string("{\"viewer\": true}\0", 17), ""},
  };
  for (const auto& [text, hint] : cases) {
    std::vector<ConfigError> errors;
    EXPECT_TRUE(ParseJsonText(text, errors).is_discarded()) << text;
    ASSERT_EQ(errors.size(), 1u) << text;
    for (const std::string& any : {comma, comment, dem, utf16}) {
      EXPECT_EQ(errors[0].message.find(any) != std::string::npos, any == hint) << text << ": " << errors[0].message;
    }
  }
}

TEST(ParseJsonText, RefusesWhatFollowsAZero) {
  EXPECT_THAT(ErrorsOf({"{}\n\0junk", 8}), ElementsAre(IsError("", "line 2, column 1: a byte of zero")));
}

TEST(ParseJsonText, RefusesNumbersThatNoDoubleHolds) {
  std::vector<ConfigError> errors;
  EXPECT_TRUE(ParseJsonText("[1e999]", errors).is_discarded());
  EXPECT_THAT(errors, ElementsAre(IsError("", "line 1, column 6: number overflow")));
  EXPECT_EQ(errors.at(0).message.find("json.exception"), std::string::npos) << errors.at(0).message;
}

TEST(ParseJsonText, ReportsKeysThatAppearTwiceWithTheirPlace) {
  EXPECT_THAT(ErrorsOf(R"({"listen": "a:1", "listen": "b:2"})"),
              ElementsAre(IsError("", "line 1, column 26: the key that ends here stands twice")));
  EXPECT_THAT(
      ErrorsOf(
          "{\"datasets\": [{\"name\": \"a\", \"sources\": [\"a.tif\"]},\n{\"name\": \"b\", \"sources\": [\"b.tif\"],"
          "\n  \"name\": \"c\",\"name\": \"c\"}]}"),
      ElementsAre(IsError("", "line 3, column 8: "), IsError("", "line 3, column 20: ")));
}

TEST(ParseJsonText, AllowsOneKeyInTwoObjects) {
  std::vector<ConfigError> errors;
  ParseJsonText(R"([{"a": {"a": 1}}, {"a": [{"a": 2}, {"a": 3}]}])", errors);
  EXPECT_TRUE(errors.empty());
}

}  // namespace
}  // namespace terrace::config
