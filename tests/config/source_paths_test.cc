#include "config/source_paths.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/config/errors.h"

namespace terrace::config {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;

class SourcePaths : public testing::Test {
 protected:
  // The folder's own name looks like a glob: only what the user wrote is one.
  SourcePaths() : folder_(fs::path(testing::TempDir()) / "sources [a*]") {
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
  EXPECT_THAT(*files, ElementsAre(In("Z.tif"), In("a.tif"), In("b.tif")));
  EXPECT_THAT(*ExpandSource("*/*.tif", folder_), ElementsAre(In("deep/c.tif")));
  EXPECT_THAT(*ExpandSource("[a-b].tif", folder_), ElementsAre(In("a.tif"), In("b.tif")));
}

TEST_F(SourcePaths, TakesAFileWhoseNameLooksLikeAGlobAsItIs) {
  EXPECT_THAT(*ExpandSource("tile[1].tif", folder_), ElementsAre(In("tile[1].tif")));
}

TEST_F(SourcePaths, LeavesAPathWithoutGlobToWhoeverOpensIt) {
  EXPECT_THAT(*ExpandSource("missing.tif", folder_), ElementsAre(In("missing.tif")));
  EXPECT_THAT(*ExpandSource("/vsicurl/https://example.org/a.tif", folder_),
              ElementsAre("/vsicurl/https://example.org/a.tif"));
}

TEST_F(SourcePaths, SaysThatNothingMatches) {
  const auto none = ExpandSource("*.hgt", folder_);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(none.error().message, "no file matches " + In("*.hgt"));
}

TEST_F(SourcePaths, ReachTheConfigWithTheirErrors) {
  const ConfigResult one = ParseConfig(R"({"datasets": [{"name": "a", "sources": ["n.*"]}]})", folder_);
  ASSERT_TRUE(one);
  EXPECT_THAT(one->datasets.at(0).sources, ElementsAre(In("n.txt")));

  const ConfigResult several = ParseConfig(R"({"datasets": [{"name": "a", "sources": ["?.tif"]}]})", folder_);
  ASSERT_FALSE(several);
  EXPECT_THAT(several.error(), ElementsAre(IsError("/datasets/0/sources", "gives 3 files")));

  const ConfigResult none = ParseConfig(R"({"datasets": [{"name": "a", "sources": ["*.hgt"]}]})", folder_);
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error(), ElementsAre(IsError("/datasets/0/sources/0", "relative to the folder of this file")));
}

}  // namespace
}  // namespace terrace::config
