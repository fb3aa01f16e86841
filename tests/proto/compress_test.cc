#include "proto/compress.h"

#include <brotli/decode.h>
#include <brotli/encode.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>

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
    EXPECT_EQ(Gunzip(Gzip(Waves(size)), size), Waves(size)) << size << " bytes";
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

std::string OneShotBrotli(const std::string& bytes) {
  std::string out(BrotliEncoderMaxCompressedSize(bytes.size()), '\0');
  std::size_t size = out.size();
  EXPECT_EQ(BrotliEncoderCompress(kBrotliQuality, BROTLI_DEFAULT_WINDOW, BROTLI_MODE_GENERIC, bytes.size(),
                                  reinterpret_cast<const std::uint8_t*>(bytes.data()), &size,
                                  reinterpret_cast<std::uint8_t*>(out.data())),
            BROTLI_TRUE);
  out.resize(size);
  return out;
}

TEST(Brotli, GivesTheBytesOfTheLibrarysOwnFunction) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, std::size_t{70'000}, kCompressedAtOnce - 1,
                                 kCompressedAtOnce, kCompressedAtOnce + 1, 3 * kCompressedAtOnce + 12'345}) {
    EXPECT_TRUE(Brotli(Waves(size)) == OneShotBrotli(Waves(size))) << size << " bytes";
  }
}

TEST(Compress, LongTextsComeBack) {
  for (const std::size_t size : {kCompressedAtOnce, kCompressedAtOnce + 1, 2 * kCompressedAtOnce, 5'000'000ul}) {
    const std::string bytes = Waves(size);
    EXPECT_TRUE(Gunzip(Gzip(bytes), size) == bytes) << size;
    EXPECT_TRUE(Unzstd(Zstd(bytes), size) == bytes) << size;
    EXPECT_TRUE(Unbrotli(Brotli(bytes), size) == bytes) << size;
    EXPECT_TRUE(Gzip(bytes) == Gzip(bytes) && Zstd(bytes) == Zstd(bytes)) << size;
  }
}

// A text that requests a stop when its second piece is first read, and counts the pages read afterwards. Its pages are
// protected, and a handler of the fault counts each page and makes it readable.
class WatchedText {
 public:
  static constexpr std::size_t kPieces = 16, kSize = kPieces * kCompressedAtOnce;

  WatchedText() : page_(static_cast<std::size_t>(::sysconf(_SC_PAGESIZE))) {
    memory_ = static_cast<char*>(::mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
    EXPECT_NE(memory_, MAP_FAILED);
    const std::string waves = Waves(kSize);
    std::copy(waves.begin(), waves.end(), memory_);
    ::mprotect(memory_, kSize, PROT_NONE);
    current_ = this;
    struct sigaction action {};
    action.sa_sigaction = [](int, siginfo_t* fault, void*) { current_->Note(static_cast<char*>(fault->si_addr)); };
    action.sa_flags = SA_SIGINFO;
    ::sigaction(SIGSEGV, &action, &before_);
  }
  ~WatchedText() {
    ::sigaction(SIGSEGV, &before_, nullptr);
    ::munmap(memory_, kSize);
  }
  WatchedText(const WatchedText&) = delete;
  WatchedText& operator=(const WatchedText&) = delete;

  std::string_view text() const { return {memory_, kSize}; }
  std::stop_token token() const { return source_.get_token(); }
  std::size_t read_after() const { return read_after_; }

 private:
  void Note(char* place) {
    if (place < memory_ || place >= memory_ + kSize) std::abort();
    if (source_.stop_requested()) read_after_ += page_;
    if (static_cast<std::size_t>(place - memory_) >= kCompressedAtOnce) source_.request_stop();
    ::mprotect(memory_ + static_cast<std::size_t>(place - memory_) / page_ * page_, page_, PROT_READ);
  }

  static inline WatchedText* current_ = nullptr;
  const std::size_t page_;
  char* memory_ = nullptr;
  std::stop_source source_;
  std::size_t read_after_ = 0;
  struct sigaction before_ {};
};

TEST(Compress, ReadsNoMoreThanAPieceAfterAStop) {
  const std::pair<const char*, std::string (*)(std::string_view, const std::stop_token&)> functions[] = {
      {"gzip", Gzip}, {"br", Brotli}, {"zstd", Zstd}};
  for (const auto& [name, compress] : functions) {
    WatchedText watched;
    EXPECT_EQ(compress(watched.text(), watched.token()), "") << name;
    EXPECT_TRUE(watched.token().stop_requested()) << name;
    EXPECT_LE(watched.read_after(), kCompressedAtOnce) << name;
  }
}

}  // namespace
}  // namespace terrace::proto
