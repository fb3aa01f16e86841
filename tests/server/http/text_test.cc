#include "server/http/text.h"

#include <gtest/gtest.h>

namespace terrace::server {
namespace {

TEST(Text, Trims) {
  EXPECT_EQ(Trim(" \ta b\t "), "a b");
  EXPECT_EQ(Trim(" \t"), "");
  EXPECT_EQ(Trim("\"a\" ", " \""), "a");
}

TEST(Text, CutsPieces) {
  std::string_view rest = " a , b;c,";
  EXPECT_EQ(NextPiece(rest, ','), "a");
  EXPECT_EQ(NextPiece(rest, ';'), "b");
  EXPECT_EQ(NextPiece(rest, ','), "c");
  EXPECT_TRUE(rest.empty());
}

TEST(Text, ReadsFiniteNumbersAlone) {
  EXPECT_EQ(FiniteNumber("-1.5e3"), -1500);
  EXPECT_EQ(PositiveNumber("0.25"), 0.25);
  for (const char* text : {"", "nan", "inf", "1e999", "1 ", " 1", "+1", "1x", "0x1p3"})
    EXPECT_FALSE(FiniteNumber(text)) << text;
  for (const char* text : {"0", "-0", "-1", "1e-999"}) EXPECT_FALSE(PositiveNumber(text)) << text;
}

TEST(Text, ReadsPlainDecimalsAlone) {
  EXPECT_EQ(PlainDecimal("0", 3), 0);
  EXPECT_EQ(PlainDecimal("120", 3), 120);
  for (const char* text : {"", "00", "01", "-1", "+1", "1.0", "1234", "1e2", " 1"})
    EXPECT_FALSE(PlainDecimal(text, 3)) << text;
}

TEST(Text, NumbersHaveCommasBetweenThem) {
  EXPECT_EQ((NumbersOf<2>("1,-2.5")), (std::array{1.0, -2.5}));
  EXPECT_EQ((NumbersOf<2>(" 1 , 2 ", " ")), (std::array{1.0, 2.0}));
  for (const char* text : {"", "1", "1,", ",1", "1,2,3", "1,x", "1, 2"}) EXPECT_FALSE(NumbersOf<2>(text)) << text;
}

TEST(Text, ParametersAreReadInOrderAndOnce) {
  constexpr std::array<const char*, 2> kNames = {"a", "b"};
  std::string seen;
  const auto read = [&](std::string_view query, std::string_view known = {}) {
    const auto set = [&](std::size_t i, const std::string& value) -> Result<void> {
      if (value == "bad") return MakeError(ErrorCode::kInvalidArgument, "it is bad");
      seen += kNames[i] + ("=" + value) + " ";
      return {};
    };
    const Result<void> done = ReadParameters(query, kNames, set, known);
    return done ? "" : done.error().message;
  };
  EXPECT_EQ(read("v=1&b=2&v=3&a=%20"), "");
  EXPECT_EQ(seen, "b=2 a=  ");
  EXPECT_EQ(read("c=1"), "unknown parameter; known are a, b");
  EXPECT_EQ(read("c=1", "others"), "unknown parameter; known are others");
  EXPECT_EQ(read("a=1&a=2"), "a is given more than once");
  EXPECT_EQ(read("b=bad&c=1"), "it is bad");
  EXPECT_EQ(read("a=%"), "malformed percent-encoding of a parameter");
}

TEST(Text, AWordIsOneOfThoseThatTheMessageLists) {
  int value = 0;
  const auto set = [&](std::string_view text) {
    const Result<void> done = SetOneOf(value, "number", text, {{"one", 1}, {"two", 2}, {"three", 3}});
    return done ? "" : done.error().message;
  };
  EXPECT_EQ(set("two"), "");
  EXPECT_EQ(value, 2);
  EXPECT_EQ(set("four"), "number must be one, two or three");
  EXPECT_EQ(value, 2);
  EXPECT_EQ(SetOneOf(value, "flag", "", {{"0", 0}, {"1", 1}}).error().message, "flag must be 0 or 1");
}

}  // namespace
}  // namespace terrace::server
