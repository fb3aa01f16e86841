#include "proto/compress.h"

#include <brotli/decode.h>
#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <cstdint>
#include <string>

namespace terrace::proto {
namespace {

std::string Gunzip(const std::string& bytes, std::size_t size) {
  std::string out(size + 1, '\0');
  z_stream stream{};
  constexpr int kGzipOnly = 16 + MAX_WBITS;
  EXPECT_EQ(inflateInit2(&stream, kGzipOnly), Z_OK);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  EXPECT_EQ(inflate(&stream, Z_FINISH), Z_STREAM_END);
  EXPECT_EQ(stream.avail_in, 0u) << "bytes after the gzip member";
  out.resize(stream.total_out);
  inflateEnd(&stream);
  return out;
}

std::string Unbrotli(const std::string& bytes, std::size_t size) {
  std::string out(size + 1, '\0');
  std::size_t length = out.size();
  EXPECT_EQ(BrotliDecoderDecompress(bytes.size(), reinterpret_cast<const std::uint8_t*>(bytes.data()), &length,
                                    reinterpret_cast<std::uint8_t*>(out.data())),
            BROTLI_DECODER_RESULT_SUCCESS);
  out.resize(length);
  return out;
}

std::string Unzstd(const std::string& bytes, std::size_t size) {
  EXPECT_EQ(ZSTD_getFrameContentSize(bytes.data(), bytes.size()), size);
  std::string out(size + 1, '\0');
  const std::size_t length = ZSTD_decompress(out.data(), out.size(), bytes.data(), bytes.size());
  EXPECT_FALSE(ZSTD_isError(length));
  out.resize(length);
  return out;
}

std::string Waves(std::size_t size) {
  std::string bytes;
  for (std::size_t i = 0; i < size; ++i) bytes.push_back(static_cast<char>((i * i / 7) % 61));
  return bytes;
}

TEST(Gzip, ZlibReadsItBack) {
  for (std::size_t size : {0u, 1u, 100u, 70000u, 1000000u}) {
    for (int level : {1, 6, 12}) {
      const std::string bytes = Waves(size);
      EXPECT_EQ(Gunzip(Gzip(bytes, level), size), bytes) << size << " bytes at level " << level;
    }
  }
}

TEST(Brotli, ItsDecoderReadsItBack) {
  for (std::size_t size : {0u, 1u, 100u, 70000u, 1000000u}) {
    EXPECT_EQ(Unbrotli(Brotli(Waves(size)), size), Waves(size)) << size << " bytes";
  }
  EXPECT_LT(Brotli(Waves(50000)).size(), 10000u);
}

TEST(Zstd, ItsDecoderReadsItBack) {
  for (std::size_t size : {0u, 1u, 100u, 70000u, 1000000u}) {
    EXPECT_EQ(Unzstd(Zstd(Waves(size)), size), Waves(size)) << size << " bytes";
  }
  EXPECT_LT(Zstd(Waves(50000)).size(), 10000u);
}

TEST(Gzip, SameBytesInSameBytesOut) { EXPECT_EQ(Gzip(Waves(50000)), Gzip(Waves(50000))); }

TEST(Gzip, HeaderHoldsNeitherTimeNorName) {
  const std::string out = Gzip("terrain");
  ASSERT_GE(out.size(), 10u);
  EXPECT_EQ(out.substr(0, 3), "\x1f\x8b\x08");
  EXPECT_EQ(out.substr(3, 5), std::string(5, '\0')) << "flags and modification time";
}

TEST(Gzip, MakesRepetitiveBytesSmaller) { EXPECT_LT(Gzip(Waves(50000)).size(), 10000u); }

}  // namespace
}  // namespace terrace::proto
