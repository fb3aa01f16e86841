// The schema, the examples and the manual say what the parser does.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "config/json_text.h"
#include "config/options.h"
#include "tests/config/errors.h"
#include "tests/support/source_dir.h"

namespace terrace::config {
namespace {

namespace fs = std::filesystem;

std::string ReadText(const fs::path& path) {
  std::ifstream stream(test_support::SourceDir() / path);
  EXPECT_TRUE(stream) << path;
  return {std::istreambuf_iterator<char>(stream), {}};
}

Json ServerSchema() { return Json::parse(ReadText("config/config.schema.json")).at("properties"); }
Json DatasetSchema() {
  return Json::parse(ReadText("config/config.schema.json")).at("/$defs/dataset/properties"_json_pointer);
}

Json ServerText(const std::string& key, const Json& value) { return Json{{key, value}}; }
Json DatasetText(const std::string& key, const Json& value) {
  Json dataset = {{"name", "a"}, {"sources", {"a.tif"}}};
  dataset[key] = value;
  return Json{{"datasets", Json::array({dataset})}};
}

void ExpectDescribed(const std::vector<OptionInfo>& options, Json schema,
                     Json (*text)(const std::string&, const Json&)) {
  schema.erase("$schema");
  EXPECT_EQ(schema.size(), options.size()) << "the schema has a key that is no option";
  for (const OptionInfo& option : options) {
    const std::string key(option.key);
    ASSERT_TRUE(schema.contains(key)) << key;
    EXPECT_FALSE(schema[key].value("description", "").empty()) << key;
    EXPECT_EQ(schema[key].contains("default") ? schema[key]["default"].dump() : "", option.default_value) << key;
    if (schema[key].contains("default")) {
      EXPECT_THAT(ErrorsOf(text(key, schema[key]["default"]).dump()), testing::IsEmpty()) << key;
    }
  }
}

TEST(Schema, DescribesEveryOptionWithItsDefault) {
  ExpectDescribed(ServerOptions(), ServerSchema(), ServerText);
  ExpectDescribed(DatasetOptions(), DatasetSchema(), DatasetText);
}

// Every range in the schema, one step beyond its ends, and its ends.
void ExpectSameRanges(const Json& schema, Json (*text)(const std::string&, const Json&)) {
  for (const auto& [key, property] : schema.items()) {
    Json range = property;
    if (property.contains("anyOf")) range = property["anyOf"][0];
    if (!range.contains("minimum")) continue;
    const double step = range["type"] == "integer" ? 1 : 1e-6;
    const double min = range["minimum"].get<double>(), max = range["maximum"].get<double>();
    for (const double inside : {min, max}) {
      EXPECT_THAT(ErrorsOf(text(key, inside).dump()), testing::IsEmpty()) << key << ' ' << inside;
    }
    for (const double outside : {min - step, max + step}) {
      EXPECT_EQ(ErrorsOf(text(key, outside).dump()).size(), 1u) << key << ' ' << outside;
    }
  }
}

TEST(Schema, HasTheRangesOfTheParser) {
  ExpectSameRanges(ServerSchema(), ServerText);
  ExpectSameRanges(DatasetSchema(), DatasetText);
}

void ExpectWordsTaken(const Json& schema, Json (*text)(const std::string&, const Json&)) {
  for (const auto& [key, property] : schema.items()) {
    if (!property.contains("enum")) continue;
    for (const Json& word : property["enum"]) {
      EXPECT_THAT(ErrorsOf(text(key, word).dump()), testing::IsEmpty()) << key << ' ' << word;
    }
  }
}

TEST(Schema, ListsTheWordsThatTheParserTakes) {
  ExpectWordsTaken(ServerSchema(), ServerText);
  ExpectWordsTaken(DatasetSchema(), DatasetText);
}

TEST(Parser, TellsTheCasesApart) {
  const Json cases = Json::parse(ReadText("tests/config/cases.json"));
  for (const Json& config : cases.at("accepted")) EXPECT_THAT(ErrorsOf(config.dump()), testing::IsEmpty()) << config;
  for (const Json& wrong : cases.at("refused")) {
    EXPECT_THAT(ErrorsOf(wrong.at("config").dump()),
                testing::ElementsAre(IsError(wrong.at("path").get<std::string>(), "")))
        << wrong;
  }
}

TEST(Examples, AreAccepted) {
  const fs::path config = test_support::SourceDir() / "config";
  std::vector<fs::path> files = {config / "samples/samples.json"};
  for (const auto& entry : fs::directory_iterator(config / "examples")) files.push_back(entry.path());
  EXPECT_GE(files.size(), 3u);
  for (const fs::path& file : files) {
    const ConfigResult loaded = LoadConfig(file);
    EXPECT_TRUE(loaded) << file << ": " << (loaded ? "" : loaded.error().front().message);
  }
}

// The manual has one table row for each option: | `key` | `--flag` | default | ...
TEST(Manual, ListsEveryOptionWithFlagAndDefault) {
  const std::string manual = ReadText("docs/configuration.md");
  for (const auto& options : {ServerOptions(), DatasetOptions()}) {
    for (const OptionInfo& option : options) {
      const std::string row = fmt::format("\n| `{}` | {} | {} | ", option.key,
                                          option.has_flag ? fmt::format("`{}`", option.Flag()) : "none",
                                          option.default_value.empty() ? "none" : "`" + option.default_value + "`");
      EXPECT_NE(manual.find(row), std::string::npos) << "docs/configuration.md lacks the row" << row;
    }
  }
}

}  // namespace
}  // namespace terrace::config
