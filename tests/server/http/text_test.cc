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

}  // namespace
}  // namespace terrace::server
