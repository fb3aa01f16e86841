// Formats whose drivers return zeros beyond the end of a file: a truncated file is refused, never served with zeros.
#include "engine/gdal/file_end.h"

#include <gdal_priv.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "engine/gdal/source_policy.h"
#include "engine/sources/read_raster.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

std::string AllBytes(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path, std::ios::binary).rdbuf();
  return text.str();
}

// Writes the raster of `spec` in another format.
std::string Written(const TempDir& dir, const RasterSpec& spec, const char* format, const std::string& name,
                    const char* option = nullptr) {
  const std::string plain = WriteRaster(dir, spec), path = dir.File(name);
  const char* const options[] = {option, nullptr};
  const GDALDatasetUniquePtr from(GDALDataset::Open(plain.c_str()));
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName(format);
  driver->CreateCopy(path.c_str(), from.get(), FALSE, const_cast<char**>(options), nullptr, nullptr)->ReleaseRef();
  return path;
}

RasterSpec Slope() {
  RasterSpec spec{.width = 30, .height = 20, .type = "Int16", .geo_transform = {8, .001, 0, 47, 0, -.001}};
  spec.value = [](int col, int row) { return 100 + col + row; };
  return spec;
}

void ExpectRefusedWhenCut(const std::string& path) {
  const std::string bytes = AllBytes(path);
  const auto whole = ElevationModel::Open(path);
  ASSERT_TRUE(whole) << whole.error().message;
  EXPECT_EQ((*whole)->info().heights.min, 100);
  EXPECT_EQ((*whole)->info().heights.max, 148);
  for (const std::size_t lost : {std::size_t{4}, bytes.size() / 8}) {
    std::ofstream(path, std::ios::binary) << bytes.substr(0, bytes.size() - lost);
    const auto served = ElevationModel::Open(path);
    const auto meshed = ReadRaster(path);
    ASSERT_FALSE(served) << path << " without " << lost << " bytes";
    ASSERT_FALSE(meshed) << path << " without " << lost << " bytes";
    for (const Error& error : {served.error(), meshed.error()}) {
      EXPECT_EQ(error.code, ErrorCode::kUnavailable);
      EXPECT_NE(error.message.find("is cut short"), std::string::npos) << error.message;
    }
  }
}

// Both bands have the heights of Slope().
std::string EnviOfTwoBands(const TempDir& dir, const char* interleave) {
  const RasterSpec spec = Slope();
  const std::string path = dir.File("dem.img");
  const char* const options[] = {interleave, nullptr};
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("ENVI");
  const GDALDatasetUniquePtr file(
      driver->Create(path.c_str(), spec.width, spec.height, 2, GDT_Int16, const_cast<char**>(options)));
  file->SetGeoTransform(const_cast<double*>(spec.geo_transform.data()));
  OGRSpatialReference crs;
  crs.importFromEPSG(4326);
  file->SetSpatialRef(&crs);
  for (int band = 1; band <= 2; ++band) {
    for (int row = 0; row < spec.height; ++row) {
      for (int column = 0; column < spec.width; ++column) {
        double height = spec.value(column, row);
        EXPECT_EQ(
            file->GetRasterBand(band)->RasterIO(GF_Write, column, row, 1, 1, &height, 1, 1, GDT_Float64, 0, 0, nullptr),
            CE_None);
      }
    }
  }
  return path;
}

TEST(FileEnd, TruncatedEnviIsRefused) {
  for (const char* interleave : {"INTERLEAVE=BSQ", "INTERLEAVE=BIL", "INTERLEAVE=BIP"}) {
    const TempDir dir;
    ExpectRefusedWhenCut(Written(dir, Slope(), "ENVI", "dem.img", interleave));
    ExpectRefusedWhenCut(EnviOfTwoBands(dir, interleave));
  }
}

TEST(FileEnd, TruncatedPartsOfAMosaicAreRefused) {
  const TempDir dir;
  const std::string part = Written(dir, Slope(), "ENVI", "dem.img"), mosaic = dir.File("mosaic.vrt");
  ASSERT_TRUE(AllowVrts());
  WriteVrt(part, mosaic);
  EXPECT_TRUE(ElevationModel::Open(mosaic));
  std::filesystem::resize_file(part, std::filesystem::file_size(part) - 4);
  const auto opened = ElevationModel::Open(mosaic);
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(opened.error().message.find(part + ": is cut short"), std::string::npos) << opened.error().message;
  ASSERT_TRUE(SetSourcePolicy({}));
}

TEST(FileEnd, TruncatedClassicNetCdfIsRefused) {
  for (const char* form : {"FORMAT=NC", "FORMAT=NC2"}) {
    const TempDir dir;
    ExpectRefusedWhenCut(Written(dir, Slope(), "netCDF", "dem.nc", form));
  }
}

TEST(FileEnd, TruncatedNetCdf4IsRefused) {
  const TempDir dir;
  const std::string path = Written(dir, Slope(), "netCDF", "dem.nc", "FORMAT=NC4"), bytes = AllBytes(path);
  EXPECT_EQ(EndOfClassicNetCdf(bytes), 0);
  EXPECT_EQ(EndOfHdf5(bytes), bytes.size());
  ExpectRefusedWhenCut(path);
}

// The versions of the superblock, with the size 0x0123456789 and other bytes.
TEST(FileEnd, OfHdf5IsInItsSuperblock) {
  for (const auto& [version, size_at, end_at] : {std::array{0, 13, 40}, {1, 13, 44}, {2, 9, 28}, {3, 9, 28}}) {
    std::string bytes = "\x89HDF\r\n\x1a\n" + std::string(56, '\x55');
    const auto at = [&](int place) -> char& { return bytes[static_cast<std::size_t>(place)]; };
    at(8) = static_cast<char>(version);
    at(size_at) = 8;
    bytes.replace(static_cast<std::size_t>(end_at), 8, std::string("\x89\x67\x45\x23\x01\0\0\0", 8));
    EXPECT_EQ(EndOfHdf5(bytes), 0x0123456789u) << version;
    for (int size = 0; size < end_at + 8; ++size)
      EXPECT_EQ(EndOfHdf5(bytes.substr(0, static_cast<std::size_t>(size))), 0u);
    at(size_at) = 4;
    EXPECT_EQ(EndOfHdf5(bytes), 0u) << "other addresses";
    at(0) = 'H';
    EXPECT_EQ(EndOfHdf5(bytes), 0u);
  }
}

TEST(FileEnd, OfAJpegIsItsMarker) {
  const TempDir dir;
  RasterSpec spec = Slope();
  spec.type = "Byte";
  spec.width = spec.height = 200;
  spec.value = [](int col, int row) { return (col * 7 + row * 13) % 100; };
  const std::string path = Written(dir, spec, "JPEG", "dem.jpg"), bytes = AllBytes(path);
  const auto opens = [&](const std::string& content) {
    std::ofstream(path, std::ios::binary) << content;
    const auto source = ElevationModel::Open(path);
    if (!source) {
      EXPECT_NE(source.error().message.find("is cut short"), std::string::npos) << source.error().message;
    }
    return source.has_value();
  };
  EXPECT_TRUE(opens(bytes));
  for (const std::size_t lost : {std::size_t{1}, std::size_t{2}, std::size_t{40}, bytes.size() / 4}) {
    EXPECT_FALSE(opens(bytes.substr(0, bytes.size() - lost))) << lost;
  }
  EXPECT_TRUE(opens(bytes + std::string(5000, 'x'))) << "as cameras append";
  // A comment with a JPEG's markers in it, as thumbnails have them.
  const std::string comment("\xff\xfe\x00\x06\xff\xd8\xff\xd9", 8);
  const std::string commented = bytes.substr(0, 2) + comment + bytes.substr(2);
  EXPECT_TRUE(opens(commented + "x"));
  EXPECT_FALSE(opens(commented.substr(0, commented.size() - 2)));
}

// Big-endian numbers of four bytes, and texts padded to four.
class Header {
 public:
  Header& N(std::uint32_t number) {
    for (int shift = 24; shift >= 0; shift -= 8) bytes_ += static_cast<char>(number >> shift & 255);
    return *this;
  }
  Header& Wide(std::uint64_t number) {
    return N(static_cast<std::uint32_t>(number >> 32)).N(static_cast<std::uint32_t>(number));
  }
  Header& T(std::string text) {
    text.resize((text.size() + 3) / 4 * 4);
    bytes_ += text;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Dimensions t (records), y of 3, x of 5; variables a(y, x) of 16 bits at byte 400, and `records` variables b(t, x).
Header WithRecords(std::uint32_t count, std::uint32_t records) {
  Header header;
  header.T("CDF\1").N(count);
  header.N(10).N(3).N(1).T("t").N(0).N(1).T("y").N(3).N(1).T("x").N(5);
  header.N(12).N(1).N(5).T("title").N(2).N(6).T("a name");
  header.N(11).N(1 + records);
  header.N(1).T("a").N(2).N(1).N(2).N(0).N(0).N(3).N(32).N(400);
  for (std::uint32_t i = 0; i < records; ++i) header.N(1).T("b").N(2).N(0).N(2).N(0).N(0).N(3).N(12).N(500 + i * 12);
  return header;
}

TEST(FileEnd, CountsTheRecordsOfClassicNetCdf) {
  EXPECT_EQ(EndOfClassicNetCdf(WithRecords(0, 2).bytes()), 400 + 30);
  EXPECT_EQ(EndOfClassicNetCdf(WithRecords(0xFFFFFFFF, 2).bytes()), 400 + 30);
  EXPECT_EQ(EndOfClassicNetCdf(WithRecords(7, 2).bytes()), 512 + 6 * 24 + 10);
  EXPECT_EQ(EndOfClassicNetCdf(WithRecords(7, 1).bytes()), 500 + 6 * 10 + 10) << "a single one is not padded";
}

TEST(FileEnd, ReadsNumbersOfEightBytes) {
  Header header;
  header.T("CDF\5").Wide(0).N(10).Wide(1).Wide(1).T("x").Wide(std::uint64_t{1} << 33).N(0).Wide(0);
  header.N(11).Wide(1).Wide(1).T("a").Wide(1).Wide(0).N(0).Wide(0).N(5).Wide(0).Wide(1000);
  EXPECT_EQ(EndOfClassicNetCdf(header.bytes()), 1000 + (std::uint64_t{4} << 33));
}

TEST(FileEnd, ADamagedHeaderStatesNothing) {
  const std::string bytes = WithRecords(7, 2).bytes();
  for (std::size_t size = 0; size < bytes.size(); ++size) EXPECT_EQ(EndOfClassicNetCdf(bytes.substr(0, size)), 0);
  EXPECT_EQ(EndOfClassicNetCdf(Header().T("CDF\1").N(0).N(10).N(0xFFFFFFFF).bytes()), 0);
}

}  // namespace
}  // namespace terrace::dem
