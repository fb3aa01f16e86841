#include "config/input/source_paths.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "tests/config/errors.h"

namespace terrace::config {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

class SourcePaths : public testing::Test {
 protected:
  // The folder's name looks like a glob, but only the text that the user wrote is one.
  SourcePaths() : folder_(fs::path(testing::TempDir()) / ("sources [a*] " + std::to_string(::getpid()))) {
    fs::remove_all(folder_);
    for (const char* name : {"b.tif", "a.tif", "Z.tif", "n.txt", "tile[1].tif", "deep/c.tif"}) {
      fs::create_directories((folder_ / name).parent_path());
      std::ofstream(folder_ / name) << '\n';
    }
  }
  ~SourcePaths() override { fs::remove_all(folder_); }

  std::string In(const char* name) const { return (folder_ / name).string(); }

  fs::path folder_;
};

TEST_F(SourcePaths, ExpandsGlobsInByteOrder) {
  const auto files = ExpandSource("?.tif", folder_);
  ASSERT_TRUE(files) << files.error().message;
  EXPECT_THAT(files->files, ElementsAre(In("Z.tif"), In("a.tif"), In("b.tif")));
  EXPECT_THAT(ExpandSource("*/*.tif", folder_)->files, ElementsAre(In("deep/c.tif")));
  EXPECT_THAT(ExpandSource("[a-b].tif", folder_)->files, ElementsAre(In("a.tif"), In("b.tif")));
}

TEST_F(SourcePaths, GlobsLeaveFoldersOut) {
  std::ofstream(folder_ / "d.zip") << '\n';
  const auto files = ExpandSource("[abd]*", folder_);  // "deep" is a folder
  ASSERT_TRUE(files) << files.error().message;
  EXPECT_THAT(files->files, ElementsAre(In("a.tif"), In("b.tif"), In("d.zip")));
  const auto none = ExpandSource("d*p/", folder_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().message, "only folders match; for the files in them, end the glob with /*");
}

TEST_F(SourcePaths, TakesAFileWhoseNameLooksLikeAGlobAsItIs) {
  EXPECT_THAT(ExpandSource("tile[1].tif", folder_)->files, ElementsAre(In("tile[1].tif")));
}

TEST_F(SourcePaths, LeavesAPathWithoutGlobToWhoeverOpensIt) {
  EXPECT_THAT(ExpandSource("missing.tif", folder_)->files, ElementsAre(In("missing.tif")));
  EXPECT_THAT(ExpandSource("/vsicurl/https://example.org/a.tif", folder_)->files,
              ElementsAre("/vsicurl/https://example.org/a.tif"));
}

TEST_F(SourcePaths, TakesTheFilesOfAFolder) {
  std::ofstream(folder_ / ".hidden") << '\n';
  const auto files = ExpandSource(".", folder_);
  ASSERT_TRUE(files) << files.error().message;
  EXPECT_TRUE(files->is_folder);
  EXPECT_EQ(files->files.size(), 5u);  // without those of its subfolders
  EXPECT_THAT(ExpandSource("deep", folder_)->files, ElementsAre(In("deep/c.tif")));
  EXPECT_FALSE(ExpandSource("deep/c.tif", folder_)->is_folder);
  fs::create_directory(folder_ / "empty");
  const auto none = ExpandSource("empty", folder_);
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message, testing::HasSubstr("/empty holds no file"));
}

TEST_F(SourcePaths, ComeBackAsTheyWereWritten) {
  const ConfigResult config =
      ParseConfig(R"({"datasets": [{"name": "a", "sources": ["?.tif", "tile[1].tif", "deep"]}]})", folder_);
  ASSERT_TRUE(config);
  const ConfigResult again = ParseConfig(ToJson(*config), "/elsewhere");
  ASSERT_TRUE(again) << again.error().front().message;
  EXPECT_EQ(again->datasets.at(0).sources, config->datasets.at(0).sources);
}

TEST_F(SourcePaths, SaysThatNothingMatches) {
  const auto none = ExpandSource("*.hgt", folder_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().message, "no file matches");
}

TEST_F(SourcePaths, ReachTheConfigWithTheirErrors) {
  const ConfigResult one = ParseConfig(R"({"datasets": [{"name": "a", "sources": ["n.*"]}]})", folder_);
  ASSERT_TRUE(one);
  EXPECT_THAT(one->datasets.at(0).sources.at(0).files, ElementsAre(In("n.txt")));

  const ConfigResult several = ParseConfig(R"({"datasets": [{"name": "a", "sources": ["?.tif"]}]})", folder_);
  ASSERT_TRUE(several);
  EXPECT_THAT(several->datasets.at(0).sources.at(0).files, ElementsAre(In("Z.tif"), In("a.tif"), In("b.tif")));

  const ConfigResult none = ParseConfig(R"({"datasets": [{"name": "a", "sources": ["*.hgt"]}]})", folder_);
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error(),
              ElementsAre(IsError("/datasets/0/sources/0",
                                  "no file matches; correct the path; a relative path starts at " + folder_.string())));
}

}  // namespace
}  // namespace terrace::config
