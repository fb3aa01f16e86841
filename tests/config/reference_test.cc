// Checks that the schema and the manual are those of the option tables, and that the parser accepts the examples and
// cases.json.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "config/input/json_text.h"
#include "config/options/option_docs.h"
#include "config/options/options.h"
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

TEST(Schema, IsNotStale) {
  EXPECT_EQ(ReadText("config/config.schema.json"), SchemaText())
      << "config/config.schema.json differs from the option tables; run make docs";
}

TEST(Manual, IsNotStale) {
  const std::string manual = ReadText("docs/configuration.md");
  const Result<std::string> updated = UpdateManual(manual);
  ASSERT_TRUE(updated) << updated.error().message;
  EXPECT_EQ(manual, *updated) << "docs/configuration.md differs from the option tables; run make docs";
}

TEST(Manual, NeedsOneMarkerForEveryTable) {
  const std::string manual = ReadText("docs/configuration.md");
  const std::string marker = "<!-- options: log -->\n", end = "<!-- end of options -->\n";
  const std::size_t at = manual.find(marker), end_at = manual.find(end, at) + end.size();
  ASSERT_NE(at, std::string::npos);
  const std::string table = manual.substr(at, end_at - at);
  const auto fails = [](const std::string& text, const std::string& part) {
    const Result<std::string> updated = UpdateManual(text);
    return !updated && updated.error().message.find(part) != std::string::npos;
  };
  EXPECT_TRUE(fails(manual.substr(0, at) + manual.substr(end_at), "log: no marker")) << "a table is missing";
  EXPECT_TRUE(fails(manual + table, "log: no such table, two of it")) << "a table stands twice";
  EXPECT_TRUE(fails(manual + "<!-- options: logs -->\n" + end, "logs: no such table")) << "of no option";
  EXPECT_TRUE(fails(manual.substr(0, end_at - end.size()), "log: no such table, two of it, or no end")) << "no end";
}

// "Did you mean" never suggests another option for the name of an option.
TEST(Options, HaveOtherWordsThatAreNoOptions) {
  for (const auto& options : {ServerOptionInfos(), DatasetOptionInfos()}) {
    for (const OptionInfo& option : options) {
      const std::string words = fmt::format(" {} ", option.other_words);
      EXPECT_EQ(words.find("  ") == std::string::npos, !option.other_words.empty()) << words;
      for (const OptionInfo& other : options) {
        EXPECT_EQ(words.find(fmt::format(" {} ", other.key)), std::string::npos) << option.key << ": " << other.key;
      }
    }
  }
}

// Help, schema and manual quote these texts or append to them.
void ExpectOneSentence(const std::vector<OptionInfo>& options) {
  for (const OptionInfo& option : options) {
    EXPECT_FALSE(option.help.empty() || option.help.ends_with('.')) << option.key;
    EXPECT_EQ(option.help.find('\n'), std::string_view::npos) << option.key;
    EXPECT_EQ(option.help.find(". "), std::string_view::npos) << option.key << ": details go into the reference";
  }
}

TEST(Help, IsOneSentenceForEveryOption) {
  ExpectOneSentence(ServerOptionInfos());
  ExpectOneSentence(DatasetOptionInfos());
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

}  // namespace
}  // namespace terrace::config
