#include <gtest/gtest.h>

#include <string>

#include "config/config.h"

namespace terrace::config {
namespace {

TEST(CheckDatasetName, TakesWhatNeedsNoEncodingInUrls) {
  for (const char* name : {"a", "maui", "SRTM_v3.1-30m", "...", "-", "0", "Datasets", "metrics2"}) {
    EXPECT_EQ(CheckDatasetName(name), "") << name;
  }
  EXPECT_EQ(CheckDatasetName(std::string(64, 'x')), "");
}

TEST(CheckDatasetName, RefusesOtherCharactersAndLengths) {
  for (const char* name : {"", " ", "a b", "a/b", "a%20b", "\xc3\xa9", "a\n", ".", ".."}) {
    EXPECT_NE(CheckDatasetName(name).find("must be 1 to 64 letters"), std::string::npos) << name;
  }
  EXPECT_NE(CheckDatasetName(std::string(65, 'x')), "");
  EXPECT_NE(CheckDatasetName(std::string("a\0b", 3)), "");
}

TEST(CheckDatasetName, RefusesUrlsOfTheServer) {
  for (const char* name : {"datasets", "viewer", "livez", "readyz", "metrics", "version", "openapi.json"}) {
    EXPECT_NE(CheckDatasetName(name).find("is a URL of the server itself"), std::string::npos) << name;
  }
}

TEST(SanitizeDatasetName, MakesAValidNameOfAnything) {
  EXPECT_EQ(SanitizeDatasetName("maui"), "maui");
  EXPECT_EQ(SanitizeDatasetName("my dem (1)"), "my-dem--1-");
  EXPECT_EQ(SanitizeDatasetName(""), "dem");
  EXPECT_EQ(SanitizeDatasetName(".."), "dem");
  EXPECT_EQ(SanitizeDatasetName("metrics"), "metrics-dem");
  for (const std::string& text : {std::string("\xe6\x97\xa5"), std::string(500, 'a'), std::string("a\0b", 3),
                                  std::string("a/../b"), std::string("viewer"), std::string("\n")}) {
    EXPECT_EQ(CheckDatasetName(SanitizeDatasetName(text)), "") << text;
  }
}

TEST(FindDuplicateNames, ReportsEveryLaterDataset) {
  std::vector<DatasetConfig> datasets(5);
  for (const std::size_t i : {0, 2, 4}) datasets[i].name = std::string(1, 'a');
  const std::vector<ConfigError> errors = FindDuplicateNames(datasets);
  ASSERT_EQ(errors.size(), 2u);  // missing names are reported elsewhere
  EXPECT_EQ(errors[0].path, "/datasets/2/name");
  EXPECT_EQ(errors[1].path, "/datasets/4/name");
}

}  // namespace
}  // namespace terrace::config
