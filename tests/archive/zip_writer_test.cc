// 3TZ files of more than 4 GiB. They begin with a hole, so that they take hardly any space.
#include "archive/files/zip_writer.h"

#include <gtest/gtest.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "engine/core/bytes.h"
#include "proto/compress.h"
#include "tests/support/scratch_directory.h"

namespace terrace::archive {
namespace {

constexpr std::uint64_t kFar = std::uint64_t{1} << 32;

// The bytes of a file from a place on.
std::string ReadFrom(const std::filesystem::path& path, std::uint64_t place, std::size_t size) {
  std::string bytes(size, '\0');
  std::ifstream file(path, std::ios::binary);
  file.seekg(static_cast<std::streamoff>(place));
  file.read(bytes.data(), static_cast<std::streamsize>(size));
  bytes.resize(static_cast<std::size_t>(file.gcount()));
  return bytes;
}

// An entry of the index that every 3TZ file has.
struct Place {
  std::uint64_t low, high, offset;
};

// The index begins after its own local header, which the last record of the directory names. Python's zipfile checks
// the directory; here the index alone is read, as clients of 3TZ do.
std::vector<Place> IndexOf(const std::filesystem::path& path, std::size_t entries) {
  const std::uint64_t size = std::filesystem::file_size(path);
  const std::uint64_t near = size - std::min<std::uint64_t>(size, 1 << 16);
  const std::string tail = ReadFrom(path, near, 1 << 16);
  const std::size_t name = tail.find("@3dtilesIndex1@");
  if (name == std::string::npos) return {};
  ByteReader numbers(std::string_view(tail).substr(name + 15, 24 * entries));
  std::vector<Place> places;
  for (std::size_t i = 0; i < entries; ++i) {
    Place place{};
    place.low = numbers.Get<std::uint64_t>();
    place.high = numbers.Get<std::uint64_t>();
    place.offset = numbers.Get<std::uint64_t>();
    places.push_back(place);
  }
  return places;
}

// `start`: of the first entry. Entries on both sides of 4 GiB if it is a little less.
void WriteAndRead(std::uint64_t start) {
  const test_support::ScratchDirectory folder;
  const std::filesystem::path path = folder.path() / "large.3tz";
  auto zip = ZipWriter::Create(path.string(), start);
  ASSERT_TRUE(zip) << zip.error().message;
  constexpr std::size_t kEntries = 40;
  for (std::size_t i = 0; i < kEntries; ++i) {
    const std::string name = "tile" + std::to_string(i), bytes(100 + i, static_cast<char>('a' + i % 26));
    const auto added = i % 2 == 0 ? zip->Add(name, bytes) : zip->AddGzip(name, proto::Gzip(bytes));
    ASSERT_TRUE(added) << added.error().message;
  }
  ASSERT_TRUE(zip->Finish());
  ASSERT_GT(std::filesystem::file_size(path), start);

  const std::vector<Place> places = IndexOf(path, kEntries);
  ASSERT_EQ(places.size(), kEntries);
  for (const Place& place : places) {
    EXPECT_GE(place.offset, start);
    EXPECT_EQ(ReadFrom(path, place.offset, 4), "PK\x03\x04") << place.offset;
  }
  // An independent reader: names, places, sizes, checksums and the end records.
  const std::string check =
      "python3 -c \"import sys, zipfile; z = zipfile.ZipFile(sys.argv[1]); assert z.testzip() is None; "
      "assert len(z.namelist()) == 41, len(z.namelist()); "
      "[exec('assert z.read(\\'tile%d\\' % i) == bytes([97 + i % 26]) * (100 + i), i') for i in range(40)]; "
      "assert min(e.header_offset for e in z.infolist()) == int(sys.argv[2]); "
      "assert all((len(e.extra) == 12) == (e.header_offset >= 2**32 - 1) for e in z.infolist())\" '" +
      path.string() + "' " + std::to_string(start);
  EXPECT_EQ(std::system(check.c_str()), 0) << check;
}

TEST(ZipWriter, ReadsBackAtTheStart) { WriteAndRead(0); }
TEST(ZipWriter, PassesFourGibibytes) { WriteAndRead(kFar - 2500); }
TEST(ZipWriter, BeginsAtTheLastOffsetOf32Bits) { WriteAndRead(kFar - 1); }
TEST(ZipWriter, BeginsBeyondFourGibibytes) { WriteAndRead(kFar + 12345); }

// Returns what failed; 0: nothing. The setting holds for the whole process.
int WriteWithFips() {
  const test_support::ScratchDirectory scratch;
  const std::string path = (scratch.path() / "fips.3tz").string();
  if (::EVP_default_properties_enable_fips(nullptr, 1) != 1) return 1;
  auto zip = ZipWriter::Create(path);
  if (!zip) return 2;
  if (!zip->Add("tileset.json", "{}") || !zip->Finish()) return 3;
  return IndexOf(path, 1).size() == 1 ? 0 : 4;
}

// In a new process, in which no other test has looked for the algorithm.
TEST(ZipWriterDeathTest, IsWrittenWhereOpensslAllowsOnlyFipsByDefault) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(std::_Exit(WriteWithFips()), testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace terrace::archive
