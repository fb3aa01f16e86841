// Every bad input is rejected with a message that names the file and the remedy.
#include <gdal_priv.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <string>

#include "engine/gdal/raster_file.h"
#include "engine/gdal/source_policy.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

void ExpectRefused(const std::string& path, const std::vector<std::string>& parts, const DemOptions& options = {}) {
  const auto source = ElevationModel::Open(path, options);
  ASSERT_FALSE(source) << path;
  EXPECT_NE(source.error().message.find(path), std::string::npos) << source.error().message;
  for (const std::string& part : parts) {
    EXPECT_NE(source.error().message.find(part), std::string::npos)
        << "no \"" << part << "\" in: " << source.error().message;
  }
}

TEST(OpenErrors, NameThatThereIsNoSource) {
  EXPECT_EQ(ElevationModel::Open(std::vector<DemFile>{}).error().code, ErrorCode::kInvalidArgument);
}

TEST(OpenErrors, NameWhatIsNoFile) {
  const TempDir dir;
  ExpectRefused(dir.File("none.tif"), {"No such file"});
  ExpectRefused(dir.path().string(), {"not a regular file"});
  ExpectRefused("<VRTDataset rasterXSize=\"2\" rasterYSize=\"2\"></VRTDataset>", {"No such file"});
  EXPECT_EQ(ElevationModel::Open(dir.File("none.tif")).error().code, ErrorCode::kNotFound);
}

TEST(OpenErrors, NameWhatIsNoRaster) {
  const TempDir dir;
  std::ofstream(dir.File("text.tif")) << "not a raster at all\n";
  ExpectRefused(dir.File("text.tif"), {"cannot be opened as a raster", "gdalinfo"});
  std::ofstream(dir.File("empty.tif")).flush();
  ExpectRefused(dir.File("empty.tif"), {"cannot be opened as a raster"});
}

TEST(OpenErrors, NameTheHeaderOfASagaRaster) {
  const TempDir dir;
  const GDALDatasetUniquePtr plain(GDALDataset::Open(WriteRaster(dir, {}).c_str()));
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("SAGA");
  const std::string samples = dir.File("dem.sdat"), header = dir.File("dem.sgrd"), renamed = dir.File("dem.SGRD");
  driver->CreateCopy(samples.c_str(), plain.get(), FALSE, nullptr, nullptr, nullptr)->ReleaseRef();
  EXPECT_TRUE(ElevationModel::Open(samples));
  ExpectRefused(header, {"is the header of a SAGA raster", "name the file with its samples, " + samples});
  std::filesystem::rename(header, renamed);
  ExpectRefused(samples, {"its header " + header + " is missing; copy it there, or rename it"});
  ExpectRefused(renamed, {"is the header of a SAGA raster"});
}

TEST(OpenErrors, NameSrtmCellsWithoutTheNameOfOne) {
  const TempDir dir;
  const std::string cell(std::size_t{1201} * 1201 * 2, '\1');
  for (const char* const name : {"srtm.hgt", "N46E008.hgt"}) std::ofstream(dir.File(name), std::ios::binary) << cell;
  ExpectRefused(dir.File("srtm.hgt"), {"its name or size is not that of an SRTM cell", "N46E008.hgt"});
  EXPECT_TRUE(ElevationModel::Open(dir.File("N46E008.hgt")));
}

// GDAL's driver of SRTM cells crashes when it reads such a file.
TEST(OpenErrors, NameFilesThatMayNotBeRead) {
  const TempDir dir;
  const std::string path = dir.File("N46E008.hgt");
  std::ofstream(path, std::ios::binary) << std::string(std::size_t{1201} * 1201 * 2, '\1');
  ::chmod(path.c_str(), 0);
  ::chmod(dir.path().c_str(), 0755);
  const uid_t user = ::geteuid();
  constexpr uid_t kNobody = 65534;
  ASSERT_TRUE(user != 0 || ::seteuid(kNobody) == 0);
  ExpectRefused(path, {"cannot be read: Permission denied"});
  ASSERT_TRUE(user != 0 || ::seteuid(user) == 0);
}

TEST(OpenErrors, OfferGeoreferencing) {
  const TempDir dir;
  ExpectRefused(WriteRaster(dir, {.georeferenced = false, .crs = ""}),
                {"no georeference", "gdal_translate -a_srs EPSG:XXXX -a_ullr west north east south in out"});
  ExpectRefused(WriteRaster(dir, {.geo_transform = {7, .1, 0, 47, 0, -.1}, .crs = ""}),
                {"no coordinate reference system", "gdal_translate -a_srs EPSG:XXXX in out", "XXXX is 4326"});
  ExpectRefused(WriteRaster(dir, {.crs = "LOCAL_CS[\"site grid\",UNIT[\"metre\",1]]"}),
                {"neither longitudes and latitudes nor eastings and northings"});
}

TEST(OpenErrors, AreNotAboutSidecarsOfAFolder) {
  const TempDir dir;
  std::ofstream(dir.File("dem.bil"), std::ios::binary) << std::string(16 * 16 * 2, 'a');
  std::ofstream(dir.File("dem.hdr")) << "NROWS 16\nNCOLS 16\nNBITS 16\nULXMAP 8\nULYMAP 47\nXDIM 0.1\nYDIM 0.1\n";
  std::ofstream(dir.File("dem.prj")) << "Projection GEOGRAPHIC\nDatum WGS84\nUnits DD\n" << std::string(1000, ' ');
  EXPECT_TRUE(IsRaster(dir.File("dem.bil")));
  EXPECT_FALSE(IsRaster(dir.File("dem.hdr")));
  EXPECT_FALSE(IsRaster(dir.File("dem.prj")));
}

TEST(OpenErrors, NameAnotherBody) {
  const TempDir dir;
  ExpectRefused(WriteRaster(dir, {.crs = "+proj=longlat +R=3396190 +no_defs"}),
                {"radius of 3396 km", "only the Earth"});
}

TEST(OpenErrors, NameUnusableSamples) {
  const TempDir dir;
  ExpectRefused(WriteRaster(dir, {.type = "CFloat32"}), {"complex", "gdal_translate -ot Float32"});
  ExpectRefused(WriteRaster(dir, {.nodata = 0}), {"only voids", "gdal_translate -a_nodata"});
  ExpectRefused(WriteRaster(dir, {.width = 1}), {"1 x 16"});
}

TEST(OpenErrors, NameAScaleThatLeavesNoHeight) {
  const TempDir dir;
  for (const double scale : {0.0, std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    ExpectRefused(WriteRaster(dir, {.scale = scale, .offset = 100}), {"scale of", "gdal_translate -a_scale"});
  }
}

TEST(OpenErrors, RefuseBombsBeforeReading) {
  const TempDir dir;
  GDALAllRegister();
  GDALDriver* driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  const char* const sparse[] = {"SPARSE_OK=TRUE",  "TILED=YES",       "BIGTIFF=YES",
                                "BLOCKXSIZE=4096", "BLOCKYSIZE=4096", nullptr};
  GDALDatasetUniquePtr(
      driver->Create(dir.File("wide.tif").c_str(), 5'000'000, 16, 1, GDT_Byte, const_cast<char**>(sparse)));
  ExpectRefused(dir.File("wide.tif"), {"5000000 x 16", "may have 4194304 on a side at most"});
  const char* const one_block[] = {"SPARSE_OK=TRUE", "TILED=YES", "BLOCKXSIZE=8192", "BLOCKYSIZE=8192", nullptr};
  GDALDatasetUniquePtr(
      driver->Create(dir.File("block.tif").c_str(), 8192, 8192, 1, GDT_Float64, const_cast<char**>(one_block)));
  ExpectRefused(dir.File("block.tif"), {"blocks of 8192 x 8192", "TILED=YES"});
}

TEST(OpenErrors, NameBadOptions) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  ExpectRefused(path, {"error fraction"}, {.error_fraction = 0});
  ExpectRefused(path, {"finest error"}, {.finest_error = -1});
  ExpectRefused(path, {"floor"}, {.floor = 1e30});
  ExpectRefused(path, {"void gap"}, {.max_void_gap = -1});
}

TEST(OpenErrors, NameDamagedFiles) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {.width = 600, .height = 600});
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  ExpectRefused(path, {});
}

// GDAL would make heights of the voids that they declare.
TEST(OpenErrors, NameDamagedSidecars) {
  const TempDir dir;
  for (const std::string& text : {std::string(), std::string("<PAMDataset><PAMRasterBand"), std::string("garbage")}) {
    const std::string path = WriteRaster(dir, {});
    for (const char* ending : {".msk", ".aux.xml"}) {
      const std::string sidecar = path + ending;
      std::ofstream(sidecar, std::ios::binary) << text;
      ExpectRefused(path, {sidecar + ": is not used by GDAL", "cannot be read", "remove it"});
      std::filesystem::remove(sidecar);
    }
  }
  const std::string path = WriteRaster(dir, {});
  std::ofstream(path + ".aux.xml") << "<?xml version=\"1.0\"?>\n<PAMDataset></PAMDataset>";
  ExpectRefused(path, {"begins with an XML declaration"});
  std::ofstream(path + ".aux.xml") << "<PAMDataset></PAMDataset>";
  EXPECT_TRUE(OpenRaster(path).has_value());
}

// Writes a mask beside the raster.
void WriteMask(const std::string& path) {
  CPLSetThreadLocalConfigOption("GDAL_TIFF_INTERNAL_MASK", "NO");
  const GDALDatasetUniquePtr raster(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
  ASSERT_EQ(raster->CreateMaskBand(GMF_PER_DATASET), CE_None);
  CPLSetThreadLocalConfigOption("GDAL_TIFF_INTERNAL_MASK", nullptr);
}

TEST(OpenErrors, OverviewsNeedNoMaskOfTheirOwn) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {.width = 64, .height = 64});
  WriteMask(path);
  {
    const GDALDatasetUniquePtr raster(GDALDataset::Open(path.c_str()));  // read-only: the overviews are in a file
    const int factor = 2;
    ASSERT_EQ(raster->BuildOverviews("AVERAGE", 1, &factor, 0, nullptr, nullptr, nullptr), CE_None);
  }
  ASSERT_TRUE(std::filesystem::exists(path + ".msk"));
  ASSERT_TRUE(std::filesystem::exists(path + ".ovr"));
  for (const int overview : {-1, 0}) {
    const auto opened = OpenRaster(path, overview);
    EXPECT_TRUE(opened.has_value()) << opened.error().message;
  }
}

// An alpha band masks, too, but a .msk is another mask.
TEST(OpenErrors, NameADamagedMaskBesideAnAlphaBand) {
  const TempDir dir;
  const std::string path = dir.File("alpha.tif");
  {
    const char* const options[] = {"ALPHA=YES", nullptr};
    GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
    const GDALDatasetUniquePtr written(driver->Create(path.c_str(), 16, 16, 2, GDT_Byte, const_cast<char**>(options)));
    written->GetRasterBand(2)->Fill(255);
  }
  EXPECT_TRUE(OpenRaster(path).has_value());
  std::ofstream(path + ".msk") << "garbage";
  const auto opened = OpenRaster(path);
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().message.find("alpha.tif.msk: is not used by GDAL"), std::string::npos);
}

class OpenErrorsOfMosaics : public testing::Test {
 protected:
  OpenErrorsOfMosaics() { EXPECT_TRUE(AllowVrts()); }
  ~OpenErrorsOfMosaics() override { EXPECT_TRUE(SetSourcePolicy({})); }

  const TempDir dir_;
  const std::string part_ = WriteRaster(dir_, {}), mosaic_ = dir_.File("mosaic.vrt");
};

TEST_F(OpenErrorsOfMosaics, NameDamagedSidecarsOfParts) {
  WriteVrt(part_, mosaic_);
  EXPECT_TRUE(ElevationModel::Open(mosaic_).has_value());
  std::ofstream(part_ + ".msk") << "garbage";
  ExpectRefused(mosaic_, {part_ + ".msk: is not used by GDAL"});
  std::filesystem::remove(part_ + ".msk");
  WriteMask(part_);
  EXPECT_TRUE(ElevationModel::Open(mosaic_).has_value());
}

TEST_F(OpenErrorsOfMosaics, NameDamagedSidecarsOfNestedMosaics) {
  const std::string inner = dir_.File("inner.vrt");
  WriteVrt(part_, inner);
  WriteMask(part_);
  std::filesystem::rename(part_ + ".msk", inner + ".msk");
  std::ofstream(mosaic_) << R"(<VRTDataset rasterXSize="16" rasterYSize="16"><SRS>EPSG:4326</SRS>
    <GeoTransform>0, 1, 0, 0, 0, -1</GeoTransform><VRTRasterBand dataType="Float32" band="1"><ComplexSource>
    <SourceFilename relativeToVRT="1">inner.vrt</SourceFilename><SourceBand>1</SourceBand><UseMaskBand>true</UseMaskBand>
    </ComplexSource></VRTRasterBand></VRTDataset>)";
  const auto opened = ElevationModel::Open(mosaic_);
  EXPECT_TRUE(opened.has_value()) << opened.error().message;
  std::filesystem::resize_file(inner + ".msk", 8);
  ExpectRefused(mosaic_, {inner + ".msk: is not used by GDAL"});
}

// GDAL would take such parts for parts without data.
TEST_F(OpenErrorsOfMosaics, NamePartsThatCannotBeOpened) {
  WriteVrt(part_, mosaic_);
  std::ofstream(part_, std::ios::trunc) << "garbage";
  ExpectRefused(mosaic_, {part_ + ": cannot be opened as a raster"});
}

}  // namespace
}  // namespace terrace::dem
