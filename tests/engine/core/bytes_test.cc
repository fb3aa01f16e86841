#include "engine/core/bytes.h"

#include <gtest/gtest.h>

#include <string>

namespace terrace {
namespace {

TEST(ByteWriter, WritesLittleEndian) {
  ByteWriter writer;
  writer.Put<std::uint16_t>(0x1234);
  writer.Put<std::uint8_t>(0xFF);
  writer.Put(1.0f);
  writer.PutBytes("ab");
  EXPECT_EQ(writer.size(), 9u);
  EXPECT_EQ(writer.Take(), std::string("\x34\x12\xFF\x00\x00\x80\x3F"
                                       "ab",
                                       9));
}

TEST(ByteWriter, PadsToAMultiple) {
  ByteWriter writer;
  writer.PadTo(4);
  EXPECT_EQ(writer.size(), 0u);
  writer.PutBytes("abcde");
  writer.PadTo(4);
  EXPECT_EQ(writer.size(), 8u);
  writer.PadTo(4);
  EXPECT_EQ(writer.Take(), std::string("abcde\0\0\0", 8));
}

TEST(ByteReader, ReadsWhatAWriterWrote) {
  ByteWriter writer;
  writer.Put<std::int32_t>(-7);
  writer.Put(-1234.5678);
  writer.PutBytes("text");
  writer.Put<std::uint64_t>(0xFEDCBA9876543210u);
  const std::string bytes = writer.Take();
  ByteReader reader(bytes);
  EXPECT_EQ(reader.remaining(), 24u);
  EXPECT_EQ(reader.Get<std::int32_t>(), -7);
  EXPECT_EQ(reader.Get<double>(), -1234.5678);
  EXPECT_EQ(reader.GetBytes(4), "text");
  EXPECT_EQ(reader.Get<std::uint64_t>(), 0xFEDCBA9876543210u);
  EXPECT_TRUE(reader.ok());
  EXPECT_EQ(reader.remaining(), 0u);
}

TEST(ByteReader, GivesZerosAfterTheFirstReadPastTheEnd) {
  for (std::size_t length = 0; length < 4; ++length) {
    const std::string bytes(length, '\x7F');
    ByteReader reader(bytes);
    EXPECT_EQ(reader.Get<std::uint32_t>(), 0u);
    EXPECT_FALSE(reader.ok());
    EXPECT_EQ(reader.remaining(), 0u);
    EXPECT_EQ(reader.Get<std::uint8_t>(), 0u);  // although a byte may be left
    EXPECT_EQ(reader.GetBytes(1), "");
  }
}

TEST(ByteReader, RefusesLengthsThatWouldOverflow) {
  ByteReader reader("abc");
  reader.Get<std::uint8_t>();
  EXPECT_EQ(reader.GetBytes(static_cast<std::size_t>(-1)), "");
  EXPECT_FALSE(reader.ok());
}

TEST(ByteReader, ReadsNothingFromNothing) {
  ByteReader reader("");
  EXPECT_EQ(reader.GetBytes(0), "");
  EXPECT_TRUE(reader.ok());
}

}  // namespace
}  // namespace terrace
