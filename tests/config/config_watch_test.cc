#include "config/file/config_watch.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <string>

namespace terrace::config {
namespace {

namespace fs = std::filesystem;

class ConfigWatchTest : public testing::Test {
 protected:
  ConfigWatchTest() {
    fs::remove_all(folder_);
    fs::create_directories(folder_ / "dems");
    Write("dems/a.tif", "");
    Write("plain.tif", "");
  }
  ~ConfigWatchTest() override { fs::remove_all(folder_); }

  void Write(const std::string& name, const std::string& text) { std::ofstream(folder_ / name) << text; }
  static std::string WithSource(const std::string& source) {
    return R"({"datasets": [{"name": "a", "sources": [")" + source + R"("]}]})";
  }

  // Loads until the file is old enough that its stamp distinguishes all changes.
  void LoadSettled() {
    later_ns_ = std::int64_t{60} * 1'000'000'000;
    ASSERT_TRUE(watch_.Load());
    ASSERT_FALSE(watch_.MayHaveChanged());
  }

  const fs::path folder_ = fs::path(testing::TempDir()) / ("config_watch_" + std::to_string(::getpid()));
  std::int64_t later_ns_ = 0;
  int loads_ = 0;
  ConfigWatch watch_{folder_ / "c.json",
                     [this] {
                       ++loads_;
                       return LoadConfig(folder_ / "c.json");
                     },
                     [this] { return ConfigWatch::SystemTimeNs() + later_ns_; }};
};

TEST_F(ConfigWatchTest, SaysNothingOfAFileThatStaysAsItIs) {
  Write("c.json", WithSource("plain.tif"));
  EXPECT_TRUE(watch_.MayHaveChanged());  // nothing was loaded
  LoadSettled();
  const int loads = loads_;
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(watch_.MayHaveChanged());
  EXPECT_EQ(loads_, loads);
}

TEST_F(ConfigWatchTest, SeesAFileOfTheSameSizeWithItsOldTime) {
  Write("c.json", WithSource("plain.tif"));
  LoadSettled();
  const auto time = fs::last_write_time(folder_ / "c.json");
  Write("c.json", WithSource("other.tif"));
  fs::last_write_time(folder_ / "c.json", time);
  EXPECT_TRUE(watch_.MayHaveChanged());
}

TEST_F(ConfigWatchTest, LooksAgainAtWhatWasReadAMomentAfterItWasWritten) {
  Write("c.json", WithSource("plain.tif"));
  ASSERT_TRUE(watch_.Load());
  EXPECT_TRUE(watch_.MayHaveChanged());
}

TEST_F(ConfigWatchTest, SeesFilesComeAndGoInFoldersAndGlobs) {
  for (const char* source : {"dems", "dems/*.tif", "de*/?.tif"}) {
    Write("c.json", WithSource(source));
    LoadSettled();
    EXPECT_FALSE(watch_.MayHaveChanged()) << source;
    Write("dems/b.tif", "");
    EXPECT_TRUE(watch_.MayHaveChanged()) << source;
    fs::remove(folder_ / "dems/b.tif");
    EXPECT_FALSE(watch_.MayHaveChanged()) << source;
    fs::rename(folder_ / "dems/a.tif", folder_ / "dems/c.tif");
    EXPECT_TRUE(watch_.MayHaveChanged()) << source;
    fs::rename(folder_ / "dems/c.tif", folder_ / "dems/a.tif");
  }
}

TEST_F(ConfigWatchTest, LooksAgainAtWhatIsWrong) {
  Write("c.json", WithSource("none/*.tif"));
  EXPECT_FALSE(watch_.Load());
  EXPECT_TRUE(watch_.MayHaveChanged());
}

TEST_F(ConfigWatchTest, SeesTheFileGo) {
  Write("c.json", WithSource("plain.tif"));
  LoadSettled();
  fs::remove(folder_ / "c.json");
  EXPECT_TRUE(watch_.MayHaveChanged());
}

}  // namespace
}  // namespace terrace::config
