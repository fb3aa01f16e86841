// Puts a secret into every place of a configuration and of the flags: no error contains it, and nothing prints a token.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "config/common/token_hash.h"
#include "config/file/parse.h"
#include "config/input/json_text.h"
#include "config/options/options.h"
#include "tests/config/errors.h"
#include "tests/support/source_dir.h"

namespace terrace::config {
namespace {

const std::string kSecret = "Vk3tSecretMarker42xyz";

bool Holds(const std::string& text) { return text.find(kSecret) != std::string::npos; }

void ExpectNotTold(const std::vector<ConfigError>& errors, const std::string& text) {
  for (const ConfigError& error : errors) {
    EXPECT_FALSE(Holds(error.path) || Holds(error.message)) << text << '\n' << error.path << ": " << error.message;
  }
}

// Forms of the secret in a place for another value.
std::vector<Json> Forms() {
  const Json text = kSecret;
  return {text,
          Json(kSecret + " \n"),
          Json("*" + kSecret + "*"),
          Json(kSecret + "/*.tif"),
          Json("Bearer " + kSecret),
          Json::array({text}),
          Json::array({text, text}),
          Json::array({Json::object({{kSecret, text}})}),
          Json::object({{kSecret, text}}),
          Json::object({{kSecret, 1}, {kSecret + "/~", text}}),
          Json::object({{"token", text}}),
          Json::object({{"token", text}, {"name", text}}),
          Json::array({Json::object({{"token", text}})}),
          Json::array({Json::object({{"name", text}, {"token", text}})}),
          Json::array({Json::object({{"path", text}, {"token", text}, {"vertical", text}, {"nodata", text}})})};
}

// Every place of the schema as a JSON Pointer; "0" stands for entries of lists.
void AddPlaces(const Json& schema, const std::string& place, std::vector<std::string>& places) {
  places.push_back(place);
  for (const char* choice : {"anyOf", "oneOf"}) {
    if (!schema.contains(choice)) continue;
    for (const Json& each : schema[choice]) AddPlaces(each, place, places);
  }
  if (schema.contains("items")) AddPlaces(schema["items"], place + "/0", places);
  if (!schema.contains("properties")) return;
  for (const auto& [key, property] : schema["properties"].items()) {
    AddPlaces(property, place + "/" + key, places);
  }
}

std::vector<std::string> Places() {
  std::ifstream file(test_support::SourceDir() / "config/config.schema.json");
  const Json schema = Json::parse(std::string{std::istreambuf_iterator<char>(file), {}});
  std::vector<std::string> places;
  AddPlaces(schema, "", places);
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  return places;
}

Json Valid() {
  return Json::parse(R"({"listen": "127.0.0.1:80", "datasets": [{"name": "a", "sources": ["a.tif"]}],
                         "tokens": [{"name": "team", "token": "0123456789abcdef", "datasets": ["a"]}]})");
}

TEST(ConfigSecrets, NoErrorTellsWhatStandsInAnyPlace) {
  const std::vector<std::string> places = Places();
  EXPECT_GE(places.size(), 80u);
  for (const OptionInfo& option : ServerOptionInfos()) {
    EXPECT_TRUE(std::binary_search(places.begin(), places.end(), "/" + std::string(option.key))) << option.key;
  }
  int refused = 0;
  for (const std::string& place : places) {
    for (const Json& form : Forms()) {
      Json config = Valid();
      try {
        config[Json::json_pointer(place)] = form;
      } catch (const Json::exception&) {  // inside a value that is not an object in the valid configuration
        continue;
      }
      const std::vector<ConfigError> errors = ErrorsOf(config.dump());
      refused += errors.empty() ? 0 : 1;
      ExpectNotTold(errors, config.dump());
    }
  }
  EXPECT_GE(refused, 800);
}

TEST(ConfigSecrets, NoErrorTellsAKeyThatIsNone) {
  for (const char* text :
       {R"({"@": 1})", R"({"@": 1, "@": 2})", R"({"@": {"a": 1, "a": 2}})", R"({"tokens": [{"@": "name"}]})",
        R"({"tokens": [{"name": "a", "token": "@", "token": "@"}]})",
        R"({"datasets": [{"name": "a", "sources": ["a.tif"], "@": 1}]})",
        R"({"disk_cache": {"directory": "a", "@": 1}})", R"({"tls": {"@": "@"}})",
        R"({"datasets": [{"name": "a", "sources": [{"path": "a", "@": "@"}], "@": {"@": 1}}]})"}) {
    std::string config = text;
    for (std::size_t at = 0; (at = config.find('@', at)) != std::string::npos;) config.replace(at, 1, kSecret);
    const std::vector<ConfigError> errors = ErrorsOf(config);
    EXPECT_FALSE(errors.empty()) << config;
    ExpectNotTold(errors, config);
  }
}

// The text is truncated at every place, and has every character of JSON's syntax inserted at every place.
TEST(ConfigSecrets, NoErrorTellsTheTextBesideAMistake) {
  const std::string text =
      R"({"tokens": [{"name": "team", "token": ")" + kSecret + R"(", "datasets": ["a"]}], "b": 1})";
  for (std::size_t at = 0; at < text.size(); ++at) {
    ExpectNotTold(ErrorsOf(text.substr(0, at)), text.substr(0, at));
    for (const char c : std::string("\"{}[],:#x\\ \n")) {
      std::string wrong = text;
      wrong[at] = c;
      ExpectNotTold(ErrorsOf(wrong), wrong);
      wrong = text;
      wrong.insert(at, 1, c);
      ExpectNotTold(ErrorsOf(wrong), wrong);
    }
  }
}

TEST(ConfigSecrets, NoErrorTellsTheTextOfAFlag) {
  for (const std::string& text :
       {kSecret, kSecret + ",\n" + kSecret, "[\"" + kSecret + "\", 1]", "{\"token\": \"" + kSecret + "\"}"}) {
    for (const std::string directory : {"/start", ""}) {
      std::vector<ConfigError> errors;
      for (const OptionInfo& option : ServerOptionInfos()) {
        Config config;
        if (option.has_flag) SetServerOption(option.key, text, directory, config, errors);
      }
      for (const OptionInfo& option : DatasetOptionInfos()) {
        DatasetConfig dataset;
        if (option.has_flag) SetDatasetOption(option.key, text, directory, dataset, errors);
      }
      EXPECT_GE(errors.size(), 40u);
      ExpectNotTold(errors, text);
    }
  }
}

TEST(ConfigSecrets, ATokenIsPrintedAsItsHash) {
  const ConfigResult config =
      ParseConfig(R"({"tokens": [{"name": "a", "token": ")" + kSecret + R"(", "datasets": ["b"]}]})", "/");
  ASSERT_TRUE(config);
  const std::string printed = ToJson(*config);
  EXPECT_FALSE(Holds(printed)) << printed;
  EXPECT_NE(printed.find(TokenHash(kSecret)), std::string::npos) << printed;
  const ConfigResult again = ParseConfig(printed, "/");
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, *config);
  EXPECT_EQ(TokenHash("0123456789abcdef"), "9f9f5111f7b27a781f1f1ddde5ebc2dd2b796bfc7365c9c28b548e564176929f");
}

TEST(ConfigSecrets, OneTokenInTwoFormsIsOne) {
  std::string upper = TokenHash(kSecret);
  std::transform(upper.begin(), upper.end(), upper.begin(), [](unsigned char c) { return std::toupper(c); });
  EXPECT_THAT(ErrorsOf(R"({"tokens": [{"name": "a", "token": ")" + kSecret + R"("}, {"name": "b", "sha256": ")" +
                       upper + R"("}]})"),
              testing::ElementsAre(IsError("/tokens/1", "is the same token as /tokens/0")));
}

TEST(ConfigSecrets, ANameThatIsATokenIsRefused) {
  EXPECT_THAT(ErrorsOf(R"({"tokens": [{"name": ")" + kSecret + R"(", "token": "0123456789abcdef"},
                                      {"name": "b", "token": ")" +
                       kSecret + R"("}]})"),
              testing::ElementsAre(IsError("/tokens/0/name", "is a token itself")));
}

// Otherwise the log would print the key as the path of a missing file.
TEST(ConfigSecrets, AKeyInsteadOfItsPathIsRefused) {
  for (const std::string& key : {R"(-----BEGIN PRIVATE KEY-----\n)" + kSecret, "-----BEGIN KEY----- " + kSecret}) {
    const std::vector<ConfigError> errors = ErrorsOf(R"({"tls": {"certificate": "a.pem", "key": ")" + key + R"("}})");
    EXPECT_THAT(errors, testing::ElementsAre(IsError("/tls", "the paths of two PEM files")));
    ExpectNotTold(errors, key);
  }
}

}  // namespace
}  // namespace terrace::config
