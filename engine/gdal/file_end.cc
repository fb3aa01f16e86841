#include "engine/gdal/file_end.h"

#include <algorithm>
#include <array>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <system_error>
#include <vector>

#include "engine/core/bytes.h"

namespace terrace::dem {
namespace {

constexpr std::uint64_t kMax = std::numeric_limits<std::uint64_t>::max();

// Sums and products of numbers of a header, which may be damaged: an overflow becomes the largest number.
std::uint64_t Times(std::uint64_t a, std::uint64_t b) { return a != 0 && b > kMax / a ? kMax : a * b; }
std::uint64_t Plus(std::uint64_t a, std::uint64_t b) { return b > kMax - a ? kMax : a + b; }
std::uint64_t PaddedToFour(std::uint64_t bytes) { return Plus(bytes, 3) / 4 * 4; }

std::uint64_t EndOfEnvi(GDALDataset& dataset) {
  const auto stated = [&dataset](const char* key) {
    const char* const text = dataset.GetMetadataItem(key, "ENVI");
    return text == nullptr ? 0 : std::strtoull(text, nullptr, 10);
  };
  if (stated("file_compression") != 0) return 0;
  const auto sample =
      static_cast<std::uint64_t>(GDALGetDataTypeSizeBytes(dataset.GetRasterBand(1)->GetRasterDataType()));
  const auto samples =
      Times(static_cast<std::uint64_t>(dataset.GetRasterXSize()), static_cast<std::uint64_t>(dataset.GetRasterYSize()));
  const auto bands = static_cast<std::uint64_t>(dataset.GetRasterCount());
  return Plus(stated("header_offset"), Times(Times(samples, bands), sample));
}

// The header of a classic file, as the "NetCDF Classic Format Specification" defines it: big-endian, names and values
// padded to four bytes.
class ClassicHeader {
 public:
  explicit ClassicHeader(std::string_view bytes) : reader_(bytes) {}

  std::uint64_t End() {
    if (reader_.GetBytes(3) != "CDF") return 0;
    version_ = static_cast<int>(Number(1));
    if (version_ != 1 && version_ != 2 && version_ != 5) return 0;
    const std::uint64_t records = Count();
    ReadDimensions();
    SkipAttributes();
    ReadVariables();
    if (!reader_.ok()) return 0;
    // A file that was written as a stream does not state the number of its records.
    const bool knows_records = records != (version_ == 5 ? kMax : 0xFFFFFFFF);
    if (!knows_records || records == 0) return end_of_fixed_;
    return std::max(end_of_fixed_, EndOfRecords(records));
  }

 private:
  struct RecordVariable {
    std::uint64_t begin = 0, bytes = 0;  // of one record
  };

  std::uint64_t Number(int bytes) {
    std::uint64_t value = 0;
    for (const char byte : reader_.GetBytes(static_cast<std::size_t>(bytes))) {
      value = value << 8 | static_cast<unsigned char>(byte);
    }
    return value;
  }
  std::uint64_t Count() { return Number(version_ == 5 ? 8 : 4); }
  void Skip(std::uint64_t bytes) { reader_.GetBytes(static_cast<std::size_t>(PaddedToFour(bytes))); }
  void SkipName() { Skip(Count()); }

  // Returns the number of elements of a list. An absent list has the tag 0.
  std::uint64_t List() {
    Number(4);
    return Count();
  }

  static std::uint64_t SizeOfType(std::uint64_t type) {
    constexpr std::uint64_t kSizes[] = {0, 1, 1, 2, 4, 4, 8, 1, 2, 4, 8, 8};
    return type < std::size(kSizes) ? kSizes[type] : 0;
  }

  void ReadDimensions() {
    for (std::uint64_t left = List(); left > 0 && reader_.ok(); --left) {
      SkipName();
      dimensions_.push_back(Count());
    }
  }

  void SkipAttributes() {
    for (std::uint64_t left = List(); left > 0 && reader_.ok(); --left) {
      SkipName();
      const std::uint64_t size = SizeOfType(Number(4));
      Skip(Times(size, Count()));
    }
  }

  void ReadVariables() {
    for (std::uint64_t left = List(); left > 0 && reader_.ok(); --left) {
      SkipName();
      std::uint64_t values = 1;
      bool has_records = false;
      const std::uint64_t dimensions = Count();
      for (std::uint64_t i = 0; i < dimensions && reader_.ok(); ++i) {
        const std::uint64_t number = Count();
        const std::uint64_t length = number < dimensions_.size() ? dimensions_[number] : 0;
        // Only the first dimension may be that of records, whose length is stated as 0.
        if (length == 0 && i == 0)
          has_records = true;
        else
          values = Times(values, length);
      }
      SkipAttributes();
      const std::uint64_t bytes = Times(values, SizeOfType(Number(4)));
      Count();  // the stated size, which has too few bits for large variables
      const std::uint64_t begin = Number(version_ == 1 ? 4 : 8);
      if (has_records) {
        of_records_.push_back({begin, bytes});
      } else {
        end_of_fixed_ = std::max(end_of_fixed_, Plus(begin, bytes));
      }
    }
  }

  std::uint64_t EndOfRecords(std::uint64_t records) const {
    std::uint64_t of_record = 0, end = 0;
    for (const RecordVariable& variable : of_records_) of_record = Plus(of_record, PaddedToFour(variable.bytes));
    if (of_records_.size() == 1) of_record = of_records_[0].bytes;  // the only one is not padded
    for (const RecordVariable& variable : of_records_) {
      end = std::max(end, Plus(Plus(variable.begin, variable.bytes), Times(records - 1, of_record)));
    }
    return end;
  }

  ByteReader reader_;
  int version_ = 0;
  std::vector<std::uint64_t> dimensions_;
  std::vector<RecordVariable> of_records_;
  std::uint64_t end_of_fixed_ = 0;
};

// Whether a JPEG has its end marker. Programs append to JPEGs, so it need not be at the end of the file: it is the
// first one outside of the segments, which may contain whole JPEGs. In the data of a scan, 0xFF is followed by 0 or
// belongs to a restart marker.
bool HasEndOfJpeg(std::istream& file) {
  constexpr int kStart = 0xD8, kEnd = 0xD9, kFirstRestart = 0xD0, kPrivate = 0x01;
  file.seekg(-2, std::ios::end);
  if (file.get() == 0xFF && file.get() == kEnd) return true;
  file.clear();
  file.seekg(0);
  while (file) {
    if (file.get() != 0xFF) continue;
    while (file.peek() == 0xFF) file.get();
    const int marker = file.get();
    if (marker == kEnd) return true;
    const bool is_alone = marker <= kPrivate || (marker >= kFirstRestart && marker <= kStart);
    if (is_alone) continue;
    const int high = file.get(), low = file.get();
    file.seekg(std::max(high * 256 + low - 2, 0), std::ios::cur);
  }
  return false;
}

}  // namespace

std::uint64_t EndOfClassicNetCdf(std::string_view bytes) { return ClassicHeader(bytes).End(); }

// The superblock, in the "HDF5 File Format Specification", section II.A: little-endian.
std::uint64_t EndOfHdf5(std::string_view bytes) {
  ByteReader reader(bytes);
  if (reader.GetBytes(8) != "\x89HDF\r\n\x1a\n") return 0;
  const auto version = reader.Get<std::uint8_t>();
  if (version > 3) return 0;
  reader.GetBytes(version < 2 ? 4 : 0);
  if (reader.Get<std::uint8_t>() != 8) return 0;  // bytes of an address
  constexpr std::array<std::size_t, 4> kUpToAddresses = {10, 14, 2, 2};
  reader.GetBytes(kUpToAddresses.at(version) + 16);  // two addresses precede that of the end
  const auto end = reader.Get<std::uint64_t>();
  return reader.ok() ? end : 0;
}

std::uint64_t EndOfSamples(GDALDataset& dataset, const std::string& path) {
  if (EQUAL(dataset.GetDriverName(), "ENVI")) return EndOfEnvi(dataset);
  if (EQUAL(dataset.GetDriverName(), "JPEG")) {
    std::ifstream file(path, std::ios::binary);
    std::error_code unknown;
    const std::uint64_t size = std::filesystem::file_size(path, unknown);
    return !file || unknown || HasEndOfJpeg(file) ? 0 : size + 2;
  }
  if (!EQUAL(dataset.GetDriverName(), "netCDF")) return 0;
  // A header has a few kilobytes; one that is larger than this is not examined.
  constexpr std::size_t kMaxHeaderBytes = std::size_t{1} << 20;
  std::string bytes(kMaxHeaderBytes, '\0');
  std::ifstream file(path, std::ios::binary);
  file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  return EndOfClassicNetCdf(std::string_view(bytes).substr(0, static_cast<std::size_t>(file.gcount())));
}

}  // namespace terrace::dem
