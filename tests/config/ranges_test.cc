#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <string>

#include "config/options/option_codec.h"
#include "tests/config/errors.h"

namespace terrace::config {
namespace {

TEST(ByteCount, ReadsNumbersAndUnits) {
  EXPECT_EQ(ByteCount(Json(268435456)), 268435456);
  EXPECT_EQ(ByteCount(Json(1e3)), 1000);
  EXPECT_EQ(ByteCount(Json("0")), 0);
  EXPECT_EQ(ByteCount(Json("7B")), 7);
  EXPECT_EQ(ByteCount(Json("512MB")), 512'000'000);
  EXPECT_EQ(ByteCount(Json("64 MiB")), 64 << 20);
  EXPECT_EQ(ByteCount(Json("1.5KiB")), 1536);
  EXPECT_EQ(ByteCount(Json("1kB")), 1000);
  EXPECT_EQ(ByteCount(Json("1KB")), 1000);
  EXPECT_EQ(ByteCount(Json("2GB")), 2'000'000'000);
  EXPECT_EQ(ByteCount(Json("1GiB")), std::int64_t{1} << 30);
  EXPECT_EQ(ByteCount(Json("1TB")), 1'000'000'000'000);
  EXPECT_EQ(ByteCount(Json("1TiB")), std::int64_t{1} << 40);
}

TEST(ByteCount, RefusesWhatIsNotPlain) {
  for (const char* text : {"", " ", "MB", "-1", "-1MB", "1mb", "1Mb", "1 MB ", "1..5MB", "1.5.2MB", ".5MB", "01MB",
                           "1e3", "0x10", "1MBB", "99999999999TiB", "1e400"}) {
    EXPECT_EQ(ByteCount(Json(text)), std::nullopt) << text;
  }
  EXPECT_EQ(ByteCount(Json(0.5)), std::nullopt);
  EXPECT_EQ(ByteCount(Json(true)), std::nullopt);
  EXPECT_EQ(ByteCount(Json()), std::nullopt);
}

TEST(WholeNumber, TakesWhatJsonKeepsExactly) {
  EXPECT_EQ(WholeNumber(Json(1000.0)), 1000);
  EXPECT_EQ(WholeNumber(Json(-3)), -3);
  EXPECT_EQ(WholeNumber(Json(1.5)), std::nullopt);
  EXPECT_EQ(WholeNumber(Json(1e300)), std::nullopt);
  EXPECT_EQ(WholeNumber(Json(UINT64_MAX)), std::nullopt);
  EXPECT_EQ(WholeNumber(Json("1")), std::nullopt);
}

TEST(NumberOut, WritesWholeValuesWithoutAFraction) {
  EXPECT_EQ(NumberOut(30).dump(), "30");
  EXPECT_EQ(NumberOut(0.25).dump(), "0.25");
}

TEST(Ranges, AreNamedInTheError) {
  EXPECT_THAT(ErrorsOf(R"({"cache_bytes": "2TiB"})"),
              testing::ElementsAre(IsError("/cache_bytes", "a number of bytes up to 1099511627776")));
  EXPECT_THAT(ErrorsOf(R"({"drain_timeout_s": -0.1})"),
              testing::ElementsAre(IsError("/drain_timeout_s", "a number of seconds from 0 to 3600")));
}

}  // namespace
}  // namespace terrace::config
