// Heights above geoids become ellipsoidal in the same way in tiles, at points, on Web Mercator, and in bounds.
#include "engine/crs/vertical_datum.h"

#include <gdal_priv.h>
#include <stdlib.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "engine/gdal/sample_rules.h"
#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

double Egm96At(Position degrees) { return (*Geoid::OfCrs("EPSG:5773", degrees))->Undulation(degrees); }

RasterSpec Hills(const std::string& crs) {
  RasterSpec spec{.width = 121, .height = 121, .geo_transform = {-71, 1.0 / 120, 0, -32, 0, -1.0 / 120}, .crs = crs};
  spec.value = [](int col, int row) { return 1000 + 300 * std::sin(col / 7.0) + 5.0 * row; };
  return spec;
}

DemOptions With(const std::string& vertical) { return {.source = {.vertical = vertical}}; }

std::vector<GeoPosition> SomePoints() {
  std::vector<GeoPosition> points;
  for (int i = 0; i < 40; ++i) points.push_back({-70.95 + i * .0223, -32.05 - i * .0217});
  return points;
}

void ExpectShifted(const ElevationModel& raw, const ElevationModel& converted) {
  const auto points = SomePoints();
  const auto before = raw.ReadPoints(points), after = converted.ReadPoints(points);
  ASSERT_TRUE(before && after);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double undulation = Egm96At({points[i].longitude, points[i].latitude});
    ASSERT_GT(undulation, 10);
    EXPECT_NEAR((*after)[i], (*before)[i] + undulation, .002) << i;
  }
}

TEST(VerticalDatum, ConvertsWhatTheConfigurationSays) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills("EPSG:4326"));
  const auto raw = OpenOrFail(path), converted = OpenOrFail(path, With("egm96"));
  ASSERT_TRUE(raw && converted);
  ExpectShifted(*raw, *converted);
  EXPECT_FALSE(raw->has_datum());
  EXPECT_TRUE(converted->has_datum());
  EXPECT_EQ(converted->info().sources.front().datum_in_use, "EGM96 height");
  EXPECT_FALSE(converted->info().sources.front().vertical_operation.empty());
  EXPECT_NE(raw->fingerprint(), converted->fingerprint());
}

TEST(VerticalDatum, ConvertsWhatTheReferenceSystemStates) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills("EPSG:4326+5773"));
  const auto stated = OpenOrFail(path), ignored = OpenOrFail(path, With("unknown")),
             denied = OpenOrFail(path, With("ellipsoid"));
  ASSERT_TRUE(stated && ignored && denied);
  ExpectShifted(*ignored, *stated);
  EXPECT_FALSE(ignored->has_datum());
  EXPECT_TRUE(denied->has_datum());
  EXPECT_EQ(*denied->ReadPoints(SomePoints()), *ignored->ReadPoints(SomePoints()));
}

// GeoTIFF has stated datums since its first version, which most files use.
TEST(VerticalDatum, ConvertsWhatAGeoTiffOfTheFirstVersionStates) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills("EPSG:4326+5773")), old = dir.File("old.tif");
  {
    const char* const options[] = {"GEOTIFF_VERSION=1.0", nullptr};
    const GDALDatasetUniquePtr now(GDALDataset::Open(path.c_str()));
    GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
    GDALDatasetUniquePtr(
        driver->CreateCopy(old.c_str(), now.get(), TRUE, const_cast<char**>(options), nullptr, nullptr));
  }
  const auto source = OpenOrFail(old), now = OpenOrFail(path);
  ASSERT_TRUE(source && now);
  EXPECT_EQ(source->info().sources.front().datum_in_use, "EGM96 height");
  EXPECT_EQ(*source->ReadPoints(SomePoints()), *now->ReadPoints(SomePoints()));
}

// GDAL's reference systems for GeoTIFFs that state only the unit of their heights, or describe them only in words.
TEST(VerticalDatum, AVerticalPartWithoutADatumStatesAUnitAlone) {
  for (const char* name : {"unknown", "Mean Sea Level"}) {
    const std::string in_feet =
        R"(COMPD_CS["unknown",GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563]],)"
        R"(PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],VERT_CS[")" +
        std::string(name) + R"(",VERT_DATUM["unknown",2005],UNIT["foot",0.3048],AXIS["Up",UP]]])";
    const TempDir dir;
    const auto metres = OpenOrFail(WriteRaster(dir, Hills("EPSG:4326"), "metres.tif"));
    const std::string path = WriteRaster(dir, Hills("EPSG:4326"), "feet.tif");
    std::ofstream(path + ".aux.xml") << "<PAMDataset><SRS dataAxisToSRSAxisMapping=\"1,2\">" << in_feet
                                     << "</SRS></PAMDataset>";
    const auto feet = OpenOrFail(path);
    ASSERT_TRUE(metres && feet);
    EXPECT_FALSE(feet->has_datum());
    EXPECT_EQ(feet->info().sources.front().height_unit, "foot");
    EXPECT_EQ(feet->info().sources.front().crs.substr(0, 6), "WGS 84");
    const auto of_feet = feet->ReadPoints(SomePoints()), of_metres = metres->ReadPoints(SomePoints());
    ASSERT_TRUE(of_feet && of_metres);
    for (std::size_t i = 0; i < of_feet->size(); ++i) EXPECT_NEAR((*of_feet)[i], (*of_metres)[i] * .3048, .002) << i;
  }
}

TEST(VerticalDatum, EllipsoidalReferenceSystemsPass) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Hills("EPSG:4979")));
  ASSERT_NE(source, nullptr);
  EXPECT_TRUE(source->has_datum());
  EXPECT_FALSE(source->has_geoid());
  EXPECT_EQ(source->info().sources.front().datum_in_use, "ellipsoid");
}

// The unit of a compound CRS has a name; the unit of a third axis has only a length, but its feet must be converted
// too.
TEST(VerticalDatum, AThirdAxisInFeetIsConverted) {
  constexpr const char* kInFeet =
      R"(GEOGCRS["in feet",DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563]],)"
      R"(CS[ellipsoidal,3],AXIS["latitude",north,ANGLEUNIT["degree",0.0174532925199433]],)"
      R"(AXIS["longitude",east,ANGLEUNIT["degree",0.0174532925199433]],)"
      R"(AXIS["height",up,LENGTHUNIT["foot",0.3048]]])";
  const TempDir dir;
  const auto metres = OpenOrFail(WriteRaster(dir, Hills("EPSG:4979")));
  const std::string path = WriteRaster(dir, Hills("EPSG:4979"), "feet.tif");
  std::ofstream(path + ".aux.xml") << "<PAMDataset><SRS dataAxisToSRSAxisMapping=\"2,1,3\">" << kInFeet
                                   << "</SRS></PAMDataset>";  // GeoTIFF cannot represent it
  const auto feet = OpenOrFail(path);
  ASSERT_TRUE(feet && metres);
  EXPECT_EQ(feet->info().sources.front().height_unit, "foot");
  EXPECT_EQ(feet->info().sources.front().datum_in_use, "ellipsoid");
  const auto of_feet = feet->ReadPoints(SomePoints()), of_metres = metres->ReadPoints(SomePoints());
  ASSERT_TRUE(of_feet && of_metres);
  for (std::size_t i = 0; i < of_feet->size(); ++i) EXPECT_NEAR((*of_feet)[i], (*of_metres)[i] * .3048, .002) << i;
}

// Heights in feet: the file states neither datum nor unit, and the configuration names both with one reference system.
TEST(VerticalDatum, AFileWithoutAUnitHasThatOfTheReferenceSystemThatTheConfigurationNames) {
  const TempDir dir;
  RasterSpec undulations{.geo_transform = {-128, 1, 0, 44, 0, -1}, .crs = "EPSG:6319"};
  undulations.value = [](int, int) { return -35.0; };
  WriteRaster(dir, undulations, "us_noaa_g2018u0.tif");
  ::setenv("PROJ_DATA", (dir.path().string() + ":/usr/share/proj").c_str(), 1);
  RasterSpec county = Hills("EPSG:4326");
  county.geo_transform = {-120, 1.0 / 120, 0, 37, 0, -1.0 / 120};
  const std::string path = WriteRaster(dir, county, "county.tif");
  county.unit = "metre";
  const std::string says_metres = WriteRaster(dir, county, "metres.tif");
  const auto raw = OpenOrFail(path), metres = OpenOrFail(path, With("EPSG:5703")),
             feet = OpenOrFail(path, With("EPSG:6360")), stated = OpenOrFail(says_metres, With("EPSG:6360"));
  ::unsetenv("PROJ_DATA");
  ASSERT_TRUE(raw && metres && feet && stated);
  EXPECT_EQ(feet->info().sources.front().height_unit, "US survey foot");
  EXPECT_NE(feet->fingerprint(), metres->fingerprint());
  const std::vector<GeoPosition> points = {{-119.5, 36.5}, {-119.62, 36.33}, {-119.07, 36.91}};
  const auto given = raw->ReadPoints(points), in_metres = metres->ReadPoints(points),
             in_feet = feet->ReadPoints(points), as_stated = stated->ReadPoints(points);
  ASSERT_TRUE(given && in_metres && in_feet && as_stated);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR((*in_metres)[i], (*given)[i] - 35, .002) << i;
    EXPECT_NEAR((*in_feet)[i], (*given)[i] * 1200 / 3937 - 35, .002) << i;
    EXPECT_EQ((*as_stated)[i], (*in_metres)[i]) << "the file's own word counts";
  }
}

TEST(VerticalDatum, TilesBoundsAndMercatorPixelsAreConvertedAlike) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills("EPSG:4326"));
  const DemOptions floored{.source = {.vertical = "egm96"}, .floor = 0};
  const auto raw = OpenOrFail(path, {.floor = 0}), converted = OpenOrFail(path, floored);
  ASSERT_TRUE(raw && converted);
  int inside = 0;
  for (int level = 0; level <= raw->max_level(); ++level) {
    for (const geo::TileKey& key : SomeTiles(*raw, level, 6)) {
      const auto before = raw->Read(key), after = converted->Read(key), counted = converted->ReadInSourceDatum(key);
      ASSERT_TRUE(before && after && counted);
      const geo::Lattice& lattice = before->lattice;
      const HeightRange bound = converted->RangeBound(key);
      EXPECT_LT(bound.max - bound.min, 2000);
      for (int j = 0; j <= lattice.cells; j += 5) {
        for (int i = 0; i <= lattice.cells; i += 5) {
          EXPECT_GE(after->At(i, j), bound.min);
          EXPECT_LE(after->At(i, j), bound.max);
          if (before->At(i, j) == 0) {
            EXPECT_EQ(after->At(i, j), 0) << "the floor is above the ellipsoid";
            continue;
          }
          const Position node{lattice.Longitude(lattice.FirstColumn(key) + i),
                              lattice.Latitude(lattice.FirstRow(key) + j)};
          ASSERT_NEAR(after->At(i, j), before->At(i, j) + Egm96At(node), .004) << geo::ToString(key);
          EXPECT_EQ(counted->At(i, j), before->At(i, j));
          ++inside;
        }
      }
    }
  }
  EXPECT_GT(inside, 1000);
  const geo::MercatorGrid grid{12};
  const NodeWindow window{static_cast<std::int64_t>((180 - 70.6) / 360 * static_cast<double>(grid.columns())),
                          grid.rows() * 595 / 1000, 64, 64};
  const auto before = raw->ReadMercator(12, window), after = converted->ReadMercator(12, window);
  ASSERT_TRUE(before && after);
  for (int i = 0; i < 64 * 64; i += 17) {
    if ((*before)[i] == 0) continue;
    const Position node{grid.Longitude(window.column + i % 64), grid.Latitude(window.row + i / 64)};
    EXPECT_NEAR((*after)[i], (*before)[i] + Egm96At(node), .004);
  }
  // Contours have the heights of the source.
  const auto lines = converted->ReadKnownMercator(12, window, HeightDatum::kSource);
  ASSERT_TRUE(lines);
  for (std::size_t i = 0; i < lines->size(); ++i) {
    if (std::isnan((*lines)[i])) continue;
    EXPECT_EQ((*lines)[i], (*before)[i]);
  }
}

TEST(VerticalDatum, NeighboursAgreeOnTheirEdge) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Hills("EPSG:4326")), With("egm96"));
  ASSERT_NE(source, nullptr);
  for (const int level : {5, 8, 10}) {
    for (const geo::TileKey& key : SomeTiles(*source, level, 5)) {
      const auto here = source->Read(key), east = source->Read(geo::Neighbour(key, 1, 0));
      ASSERT_TRUE(here && east);
      for (int j = 0; j <= here->lattice.cells; ++j) {
        ASSERT_EQ(here->At(here->lattice.cells, j), east->At(0, j)) << geo::ToString(key);
        ASSERT_EQ(here->At(here->lattice.cells + 1, j), east->At(1, j)) << geo::ToString(key);
      }
    }
  }
}

TEST(VerticalDatum, TheDefaultFloorLiesBelowEveryHeight) {
  TERRACE_REQUIRE_DATA(path, "srtm3_S33W071_andes.tif");
  const auto source = OpenOrFail(path, With("egm96"));
  ASSERT_NE(source, nullptr);
  const RasterInfo& raster = source->info().sources.front();
  EXPECT_EQ(raster.heights.min, 250);
  EXPECT_LE(source->info().floor, 250 + 40);
  EXPECT_GT(source->info().floor, 250 + 5) << "a bound of the whole Earth";
  EXPECT_GT(source->info().heights.max, raster.heights.max + 20);
  EXPECT_LT(source->info().heights.max, raster.heights.max + 60);
}

TEST(VerticalDatum, PoleRowsAreOneValueWithTheGeoidOfThePole) {
  RasterSpec spec{.width = 360, .height = 180, .geo_transform = {-180, 1, 0, 90, 0, -1}};
  spec.value = [](int, int) { return 100.0; };
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, spec), With("egm96"));
  ASSERT_NE(source, nullptr);
  for (const geo::TileKey& key : {geo::TileKey{2, 1, 3}, geo::TileKey{2, 6, 3}}) {
    const auto tile = source->Read(key);
    ASSERT_TRUE(tile);
    for (int i = 0; i <= tile->lattice.cells; ++i) {
      ASSERT_EQ(tile->At(i, tile->lattice.cells), tile->At(0, tile->lattice.cells));
    }
    EXPECT_NEAR(tile->At(0, tile->lattice.cells), 100 + Egm96At({0, 90}), .002);
    EXPECT_GE(tile->At(0, tile->lattice.cells), source->RangeBound(key).min);
    EXPECT_LE(tile->At(0, tile->lattice.cells), source->RangeBound(key).max);
  }
}

TEST(VerticalDatum, OrthometricHeightsAreTheSourcesOwnOrAboveEgm96) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills("EPSG:4326"));
  const auto raw = OpenOrFail(path), geoid = OpenOrFail(path, With("egm96")),
             ellipsoid = OpenOrFail(path, With("ellipsoid"));
  ASSERT_TRUE(raw && geoid && ellipsoid);
  const auto points = SomePoints();
  const auto plain = raw->ReadPoints(points);
  EXPECT_EQ(*geoid->ReadPoints(points, HeightDatum::kOrthometric), *plain);
  const auto below = ellipsoid->ReadPoints(points, HeightDatum::kOrthometric);
  ASSERT_TRUE(below);
  for (std::size_t i = 0; i < points.size(); ++i) {
    EXPECT_NEAR((*below)[i], (*plain)[i] - Egm96At({points[i].longitude, points[i].latitude}), .002);
  }
}

TEST(VerticalDatum, TheGridIsOneOfItsFiles) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills("EPSG:4326"));
  const std::filesystem::path installed = (*Geoid::OfCrs("EPSG:5773", {0, 0}))->files().path(0);
  // PROJ recognizes formats by the extension: .gtx or .tif, depending on the installed file.
  const std::string grid = dir.File("geoid" + installed.extension().string());
  std::filesystem::copy_file(installed, grid);
  const auto source = OpenOrFail(path, With(grid));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->files().FirstChanged(), std::nullopt);
  std::filesystem::last_write_time(grid, std::filesystem::file_time_type::clock::now() - std::chrono::hours(1));
  EXPECT_EQ(source->files().FirstChanged(), grid);
}

TEST(VerticalDatum, RefusesWithTheFileAndTheWayOut) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, Hills("EPSG:4326"));
  if (!Geoid::OfCrs("EPSG:3855", {0, 0})) {
    const auto refused = ElevationModel::Open(path, With("egm2008"));
    ASSERT_FALSE(refused);
    for (const std::string& part : {path, std::string("us_nga_egm08_25.tif"), std::string("cdn.proj.org")}) {
      EXPECT_NE(refused.error().message.find(part), std::string::npos) << refused.error().message;
    }
  }
  const auto missing = ElevationModel::Open(path, With(dir.File("none.gtx")));
  ASSERT_FALSE(missing);
  EXPECT_NE(missing.error().message.find("none.gtx is no file"), std::string::npos) << missing.error().message;
}

}  // namespace
}  // namespace terrace::dem
