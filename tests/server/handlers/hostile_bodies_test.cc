// Bodies designed to be expensive: each is read at most once, up to its first error, in at most twice its size of
// memory, and reading ends at the stop token.
#include <gtest/gtest.h>

#include <stop_token>
#include <string>
#include <vector>

#include "server/query/heights_parameters.h"
#include "server/query/heights_query.h"
#include "server/query/streamed_parameters.h"
#include "tests/server/handlers/allocations.h"

namespace terrace::server {
namespace {

constexpr std::size_t kSize = 640'000, kMaxLocations = 10'000;
// Memory for the smallest body: the parser itself, the message, the current item.
constexpr std::size_t kOverhead = 8'192;

std::string Repeated(std::string begin, std::string_view piece) {
  while (begin.size() + piece.size() <= kSize) begin += piece;
  return begin;
}

struct Hostile {
  const char* name;
  bool is_json;
  std::string body;
  const char* says;       // null: the body is read to its end without an error
  std::size_t most_read;  // bytes
};

// An error at the beginning is found in the first part.
std::vector<Hostile> HostileBodies() {
  return {
      {"ListOfObjects", true, Repeated("[", "{},"), "not a JSON object", kPartBytes},
      {"NestedObjects", true, Repeated("", "{\"v\":"), "values must be", kPartBytes},
      {"NestedLists", true, Repeated("{\"v\":", "["), "values must be", kPartBytes},
      {"ObjectsOfKeys", true, Repeated("{", "\"i\":{},"), "unknown parameter", kPartBytes},
      {"KnownKeysAgain", true, Repeated("{", "\"step\":1,"), "step is given more than once", kPartBytes},
      {"OneKey", true, Repeated("{\"", "k"), "unknown parameter", kPartBytes},
      {"OneText", true, Repeated("{\"locations\":\"", "1"), "item 1 is longer than", kPartBytes},
      {"OneNumber", true, Repeated("{\"step\":", "1"), "step is longer than", kPartBytes},
      {"EscapedText", true, Repeated("{\"datum\":\"", "\\u0000"), "datum is longer than", kPartBytes},
      {"TooManyPoints", true, Repeated("{\"locations\":\"", "0,0|"), "more than 10000 points", kPartBytes},
      {"IgnoredKeys", true, Repeated("{", "\"v\":0,"), "no valid JSON", kSize},
      {"IgnoredText", true, Repeated("{\"v\":\"", "\\u00e9"), "no valid JSON", kSize},
      {"Blanks", true, Repeated("", "\n"), "no valid JSON", kSize},
      {"FormOfPairs", false, Repeated("", "v=&"), nullptr, kSize},
      {"FormOfNothing", false, Repeated("", "&"), nullptr, kSize},
      {"FormOfUnknownPairs", false, Repeated("", "a=b&"), "unknown parameter", kPartBytes},
      {"FormOfEncodedPoints", false, Repeated("locations=", "%30,0%7C"), "more than 10000 points", 2 * kPartBytes},
      {"FormOfOneName", false, Repeated("", "n"), "unknown parameter", kPartBytes},
  };
}

Result<void> Read(const Hostile& hostile, const TextParts& parts, ListParameters parameters) {
  std::size_t at = 0;
  return hostile.is_json ? ReadJsonObject(parts, parameters, at) : ReadForm(parts, PlusSign::kIsBlank, parameters, at);
}

TEST(HostileBodies, AreReadAtMostOnceAndToTheirFirstFault) {
  for (const Hostile& hostile : HostileBodies()) {
    std::size_t read = 0;
    const TextParts inner = PartsOf(hostile.body, {});
    const TextParts parts = [&]() -> Result<std::string_view> {
      Result<std::string_view> part = inner();
      read += part->size();
      return part;
    };
    std::vector<dem::GeoPosition> points;
    const Result<void> result = Read(hostile, parts, HeightsParameters(kMaxLocations, hostile.body.size(), points));
    EXPECT_EQ(!result, hostile.says != nullptr) << hostile.name;
    if (!result) {
      EXPECT_NE(result.error().message.find(hostile.says), std::string::npos)
          << hostile.name << ": " << result.error().message;
    }
    EXPECT_LE(read, hostile.most_read) << hostile.name;
  }
}

TEST(HostileBodies, TakeAtMostTwiceTheirSize) {
  for (const Hostile& hostile : HostileBodies()) {
    const char* const type = hostile.is_json ? "application/json" : "application/x-www-form-urlencoded";
    const std::size_t before = held_bytes;
    peak_bytes = before;
    const Result<HeightsQuery> query = ParseHeights({{}, type, hostile.body}, kMaxLocations);
    EXPECT_FALSE(query) << hostile.name;
    EXPECT_LE(peak_bytes - before, 2 * hostile.body.size() + kOverhead) << hostile.name;
  }
}

TEST(HostileBodies, AsManyPointsAsThereMayBeTakeAtMostTwiceTheirSize) {
  std::string body = "{\"locations\":\"46.51,8.12";
  for (std::size_t i = 1; i < kMaxLocations; ++i) body += "|46.51,8.12";
  body += "\"}";
  const std::size_t before = held_bytes;
  peak_bytes = before;
  const Result<HeightsQuery> query = ParseHeights({{}, "application/json", body}, kMaxLocations);
  ASSERT_TRUE(query) << query.error().message;
  EXPECT_EQ(query->points.size(), kMaxLocations);
  EXPECT_LE(peak_bytes - before, 2 * body.size() + kOverhead);
}

TEST(HostileBodies, EndAtTheNextPartOnceAStopIsRequested) {
  for (const Hostile& hostile : HostileBodies()) {
    if (hostile.most_read < kSize) continue;
    std::stop_source source;
    std::size_t read = 0;
    const TextParts inner = PartsOf(hostile.body, source.get_token());
    const TextParts parts = [&]() -> Result<std::string_view> {
      Result<std::string_view> part = inner();
      if (part) read += part->size();
      if (read >= 3 * kPartBytes) source.request_stop();
      return part;
    };
    std::vector<dem::GeoPosition> points;
    const Result<void> result = Read(hostile, parts, HeightsParameters(kMaxLocations, hostile.body.size(), points));
    ASSERT_FALSE(result) << hostile.name;
    EXPECT_EQ(result.error().code, ErrorCode::kCancelled) << hostile.name;
    EXPECT_EQ(read, 3 * kPartBytes) << hostile.name;
  }
}

}  // namespace
}  // namespace terrace::server
