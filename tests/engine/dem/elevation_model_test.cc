// Results of Open, and promises of Read on real rasters.
#include "engine/dem/elevation_model.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

TEST(ElevationModel, DepthFollowsTheSpacing) {
  const std::map<std::string, int> depths = {
      {"srtm3_N46E008_swiss_alps.tif", 13}, {"srtm3_S33W071_andes.tif", 13},
      {"bigtujunga_30m_utm11.tif", 14},     {"webmercator_sf_float32.tif", 17},
      {"lidar_slovenia_1m_nodata.tif", 19}, {"lidar_greenriver_1m.tif", 19},
      {"etopo5_global_10min.tif", 5},       {"antimeridian_hawaii_topobathy_5min.tif", 6}};
  for (const auto& [name, depth] : depths) {
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    EXPECT_EQ(source->max_level(), depth) << name << ", spacing " << source->info().sources[0].spacing_m;
  }
}

TEST(ElevationModel, FinestErrorSetsTheDepth) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {.geo_transform = {7, .01, 0, 47, 0, -.01}});
  EXPECT_EQ(OpenOrFail(path, {.finest_error = 1000})->max_level(), 6);
  EXPECT_EQ(OpenOrFail(path, {.finest_error = 1e-9})->max_level(), geo::kMaxLevel);
  EXPECT_EQ(OpenOrFail(path, {.error_fraction = 1, .finest_error = 1000})->max_level(), 7);
}

TEST(ElevationModel, LatticeIsTheCoarsestThatIsAsFineAsTheSource) {
  TERRACE_REQUIRE_DATA(path, "srtm3_S33W071_andes.tif");
  const auto source = OpenOrFail(path);
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->LatticeOf(0).cells, 256);
  EXPECT_EQ(source->LatticeOf(10).cells, 256);  // 2.47", the level above has 4.9"
  EXPECT_EQ(source->LatticeOf(11).cells, 128);
}

TEST(ElevationModel, LatticesOfTheTwoDeepestLevelsAreTwiceAsFineAsTheSource) {
  TERRACE_REQUIRE_DATA(path, "srtm3_S33W071_andes.tif");
  const auto source = OpenOrFail(path);
  ASSERT_NE(source, nullptr);
  ASSERT_EQ(source->max_level(), 13);
  EXPECT_EQ(source->LatticeOf(12).cells, 128);  // 1.24"
  EXPECT_EQ(source->LatticeOf(13).cells, 64);
  const auto deeper = OpenOrFail(path, {.finest_error = 0.6});
  ASSERT_NE(deeper, nullptr);
  ASSERT_EQ(deeper->max_level(), 16);
  EXPECT_EQ(deeper->LatticeOf(12).cells, 64);
  EXPECT_EQ(deeper->LatticeOf(16).cells, 32);  // 0.31", though nothing was added
}

// For each of two sources and for all combinations of their depths.
TEST(ElevationModel, EverySourceOfAMosaicHasALatticeTwiceAsFineAtItsOwnDeepestLevel) {
  const TempDir dir;
  constexpr double kFine = 0.65 / 3600;  // nodes are 0.62" apart where nothing is added
  const std::string fine = WriteRaster(dir, FlatSquare(10, 50, 20, kFine, 5), "fine.tif");
  for (const double times : {1.0, 1.1, 1.5, 1.85, 2.0, 2.5, 3.0, 5.0}) {
    const std::string coarse =
        WriteRaster(dir, FlatSquare(10, 50, 20, kFine * times, 5), "coarse" + std::to_string(times) + ".tif");
    const auto alone = OpenOrFail(coarse), both = OpenOrFail({{fine, 0}, {coarse, 1}});
    ASSERT_TRUE(alone && both);
    EXPECT_LE(both->LatticeOf(alone->max_level()).StepDegrees(), kFine * times / 2) << times;
    EXPECT_LE(both->LatticeOf(both->max_level()).StepDegrees(), kFine / 2);
  }
}

TEST(ElevationModel, InfoTellsWhatTheFileSays) {
  TERRACE_REQUIRE_DATA(path, "bigtujunga_30m_utm11.tif");
  const auto source = OpenOrFail(path);
  ASSERT_NE(source, nullptr);
  const RasterInfo& info = source->info().sources.at(0);
  EXPECT_EQ(info.driver, "GTiff");
  EXPECT_EQ(info.width, 1197);
  EXPECT_EQ(info.height, 643);
  EXPECT_EQ(info.data_type, "Int16");
  EXPECT_EQ(info.crs, "WGS 84 / UTM zone 11N (EPSG:32611)");
  EXPECT_EQ(info.vertical_datum, "");
  EXPECT_EQ(info.pixel_width, 30);
  EXPECT_EQ(info.pixel_unit, "metre");
  EXPECT_EQ(info.heights.min, 315);
  EXPECT_EQ(info.heights.max, 2295);
  EXPECT_EQ(source->info().floor, 315);
  EXPECT_EQ(info.void_samples, 0u);
  EXPECT_EQ(info.valid_samples, 1197u * 643u);
  EXPECT_EQ(info.nodata, 32767);
  EXPECT_NEAR(info.spacing_m, 30, .02);
  EXPECT_NEAR(info.bounds.west, -118.3457, 1e-3);
  EXPECT_NEAR(info.bounds.north, 34.4090, 1e-3);
  EXPECT_FALSE(info.transform.empty());
}

TEST(ElevationModel, CompoundCrsStatesItsVerticalDatum) {
  const TempDir dir;
  const auto source =
      OpenOrFail(WriteRaster(dir, {.geo_transform = {500000, 30, 0, 5000000, 0, -30}, .crs = "EPSG:32611+5773"}));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(source->info().sources[0].vertical_datum, "EGM96 geoid");
  EXPECT_NE(source->info().sources[0].crs.find("UTM zone 11N"), std::string::npos);
}

// Heights above the ellipsoid of Bessel are up to 50 m from those above that of WGS 84.
TEST(ElevationModel, ThreeDimensionalCrsOnAnotherEllipsoidIsRefused) {
  const TempDir dir;
  RasterSpec spec{.geo_transform = {14, 0.001, 0, 48, 0, -0.001}, .crs = "EPSG:9267"};  // MGI, three-dimensional
  const auto refused = ElevationModel::Open(WriteRaster(dir, spec, "mgi.tif"));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(refused.error().message.find("Bessel 1841"), std::string::npos) << refused.error().message;
  DemOptions options;
  options.source.vertical = "ellipsoid";
  EXPECT_TRUE(ElevationModel::Open((dir.path() / "mgi.tif").string(), options));
  spec.crs = "EPSG:4937";  // ETRS89, on GRS 80
  EXPECT_TRUE(ElevationModel::Open(WriteRaster(dir, spec, "etrs.tif")));
}

// Rasters with places that their reference system cannot place on Earth say so.
TEST(ElevationModel, PlacesOutsideTheProjectionAreWarnedOf) {
  const TempDir dir;
  const auto has_warning = [&](const RasterSpec& spec, const std::string& text) {
    const auto model = OpenOrFail(WriteRaster(dir, spec));
    if (!model) return false;
    return std::ranges::any_of(model->info().sources[0].warnings,
                               [&](const std::string& warning) { return warning.find(text) != std::string::npos; });
  };
  RasterSpec spec{.width = 300, .height = 300, .geo_transform = {-7e6, 5e4, 0, 7e6, 0, -5e4}};
  spec.crs = "+proj=ortho +lat_0=50 +lon_0=10 +datum=WGS84 +units=m";  // corners of the map show no part of the Earth
  EXPECT_TRUE(has_warning(spec, "places at its rim"));
  spec.geo_transform = {-1e6, 5e3, 0, 1e6, 0, -5e3};
  EXPECT_FALSE(has_warning(spec, "places at its rim"));
  EXPECT_FALSE(has_warning(spec, "do not lead back"));
  // Coordinates of EPSG:5514, whose axes run the other way.
  EXPECT_TRUE(
      has_warning({.geo_transform = {-650000, 90, 0, -1100000, 0, -90}, .crs = "EPSG:5513"}, "do not lead back"));
}

// Columns of a rotated grid are no meridians: it may contain a pole, as those of climate models do.
TEST(ElevationModel, RotatedPoleGridReachesThePole) {
  const TempDir dir;
  RasterSpec spec{.width = 300, .height = 300, .geo_transform = {-3, 0.02, 0, 9.55, 0, -0.02}};
  spec.crs = "+proj=ob_tran +o_proj=longlat +o_lat_p=6.55 +lon_0=180 +datum=WGS84 +no_defs";
  spec.value = [](int column, int row) { return 1000.0 + column + 2 * row; };
  const auto model = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_NE(model, nullptr);
  EXPECT_EQ(model->info().bounds.north, 90);
  for (int level = 0; level <= model->max_level(); ++level) {
    for (std::int64_t x = 0; x < geo::TileColumns(level); ++x) {
      EXPECT_TRUE(model->IsAvailable({level, x, geo::TileRows(level) - 1})) << level << ' ' << x;
    }
  }
  const geo::Lattice lattice = model->LatticeOf(model->max_level());
  const NodeWindow beside{0, lattice.rows() - 8, 64, 9};
  const auto nodes = model->ReadNodes(lattice.level, beside);
  std::vector<GeoPosition> points;
  for (int j = 0; j < beside.rows; ++j) {
    for (int i = 0; i < beside.columns; ++i) points.push_back({lattice.Longitude(i), lattice.Latitude(beside.row + j)});
  }
  const auto heights = model->ReadPoints(points);
  ASSERT_TRUE(nodes && heights);
  for (std::size_t n = 0; n < points.size(); ++n) {
    EXPECT_NEAR((*nodes)[n], (*heights)[n], 0.01) << points[n].longitude << ' ' << points[n].latitude;
  }
}

TEST(ElevationModel, VoidsNeverAppearAsHeights) {
  for (const std::string name : {"srtm3_N46E008_swiss_alps.tif", "lidar_slovenia_1m_nodata.tif",
                                 "srtm1_N48W125_cape_flattery_half_void.tif", "pole_antarctica_bedmap_5km.tif"}) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    ASSERT_GT(source->info().sources[0].void_samples, 0u);
    const auto [low, high] = source->info().heights;
    for (int level = 0; level <= source->max_level(); ++level) {
      for (const geo::TileKey& key : SomeTiles(*source, level, 4)) {
        const auto tile = source->Read(key);
        ASSERT_TRUE(tile) << tile.error().message;
        for (const float height : tile->heights) {
          ASSERT_TRUE(height >= low - 0.001 && height <= high + 0.001) << height << " in " << geo::ToString(key);
          ASSERT_EQ(height * 1024, std::round(height * 1024)) << "not a multiple of 2^-10 m";
        }
      }
    }
  }
}

TEST(ElevationModel, StopsWhenAsked) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, {}));
  ASSERT_NE(source, nullptr);
  std::stop_source stop;
  stop.request_stop();
  const auto tile = source->Read({0, 1, 0}, stop.get_token());
  ASSERT_FALSE(tile);
  EXPECT_EQ(tile.error().code, ErrorCode::kCancelled);
}

TEST(ElevationModel, ReportsProgressToTheEnd) {
  const TempDir dir;
  double last = 0;
  DemOptions options;
  options.progress = [&](double done) {
    EXPECT_GE(done, last);
    last = done;
  };
  OpenOrFail(WriteRaster(dir, {.width = 300, .height = 700, .geo_transform = {7, .01, 0, 47, 0, -.01}}), options);
  EXPECT_EQ(last, 1);
}

TEST(ElevationModel, FingerprintFollowsOptions) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {});
  const std::uint64_t before = OpenOrFail(path)->fingerprint();
  EXPECT_EQ(OpenOrFail(path)->fingerprint(), before);
  EXPECT_NE(OpenOrFail(path, {.floor = 7})->fingerprint(), before);
  EXPECT_NE(OpenOrFail(path, {.max_void_gap = 3})->fingerprint(), before);
  EXPECT_NE(OpenOrFail(path, {.error_fraction = 0.4})->fingerprint(), before);
  EXPECT_NE(OpenOrFail(path, {.finest_error = 3})->fingerprint(), before);
  EXPECT_NE(OpenOrFail(path, {.holes = HoleFill::kFloor})->fingerprint(), before);
  EXPECT_NE(OpenOrFail(path, {.feather = 30})->fingerprint(), before);
}

TEST(ElevationModel, LeavesNoFilesBesideTheSource) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, {}));
  ASSERT_TRUE(source->Read({3, 8, 3}));
  const std::filesystem::directory_iterator files(dir.path());
  EXPECT_EQ(std::distance(begin(files), end(files)), 1);
}

TEST(ElevationModel, LeavesFilesWithoutAHeightOutOfAFolder) {
  const TempDir dir;
  RasterSpec empty{.geo_transform = {40, 1, 0, 0, 0, -1}, .nodata = -1};
  empty.value = [](int, int) { return -1.0; };
  const std::string good = WriteRaster(dir, {}, "good.tif"), none = WriteRaster(dir, empty, "none.tif");
  const auto source = ElevationModel::Open({{none, 0, true}, {good, 0, true}, {none, 0, true}});
  ASSERT_TRUE(source) << source.error().message;
  ASSERT_EQ((*source)->info().sources.size(), 1u);
  EXPECT_EQ((*source)->info().sources.front().path, good);
  for (const bool in_folder : {false, true}) {  // named files, or all files of the folder
    const auto alone = ElevationModel::Open({{none, 0, in_folder}});
    ASSERT_FALSE(alone);
    EXPECT_NE(alone.error().message.find("none.tif: has no valid sample"), std::string::npos);
  }
  EXPECT_FALSE(ElevationModel::Open({{good, 0, false}, {none, 1, false}}));
}

// Such a name does not fit into one line of a log or of a configuration.
TEST(ElevationModel, LeavesFilesWithALineBreakInTheirNameOutOfAFolder) {
  const TempDir dir;
  const std::string good = WriteRaster(dir, {}, "good.tif"), other = WriteRaster(dir, {}, "plain.tif");
  const std::string broken = dir.path().string() + "/a\nb.tif";
  std::filesystem::rename(other, broken);
  const auto source = ElevationModel::Open({{good, 0, true}, {broken, 0, true}});
  ASSERT_TRUE(source) << source.error().message;
  EXPECT_EQ((*source)->info().sources.size(), 1u);
  ASSERT_EQ((*source)->info().left_out.size(), 1u);
  EXPECT_NE((*source)->info().left_out.front().find("a\\x0ab.tif"), std::string::npos)
      << (*source)->info().left_out.front();
  const auto named = ElevationModel::Open({{broken, 0, false}});
  ASSERT_FALSE(named);
  EXPECT_EQ(named.error().message.find('\n'), std::string::npos);
  EXPECT_NE(named.error().message.find("a\\x0ab.tif: a file name with a control character"), std::string::npos)
      << named.error().message;
}

// A raster with colours is served, with a warning.
TEST(ElevationModel, TellsPicturesFromHeights) {
  TERRACE_REQUIRE_DATA(photo, "ortho_pair_rgb_2m.tif");
  TERRACE_REQUIRE_DATA(palette, "bluemarble_1920x960.tif");
  TERRACE_REQUIRE_DATA(bytes, "ortho_pair_dtm_2m_byte.tif");
  const auto part_of = [](const std::string& path) {
    const auto source = OpenOrFail(path);
    return source == nullptr ? "" : source->info().sources.front().picture_color;
  };
  EXPECT_EQ(part_of(photo), "Red");
  EXPECT_EQ(part_of(palette), "Palette");
  EXPECT_EQ(part_of(bytes), "");
}

TEST(ElevationModel, OpensFromKeptStatisticsAloneAndChecksAllFiles) {
  const TempDir dir;
  const std::string path = WriteRaster(dir, {.geo_transform = {7, .01, 0, 47, 0, -.01}}), cache = dir.File("cache"),
                    wrong = dir.File("wrong.tif");
  std::ofstream(wrong) << "no raster";
  DemOptions options;
  options.cache = CacheIn(cache);
  const auto lacks = ElevationModel::OpenFromCache({{path}}, options);
  ASSERT_FALSE(lacks);
  EXPECT_EQ(lacks.error().code, ErrorCode::kCancelled);
  const auto is_checked = ElevationModel::OpenFromCache({{path}, {wrong}}, options);
  ASSERT_FALSE(is_checked);
  EXPECT_NE(is_checked.error().code, ErrorCode::kCancelled);
  EXPECT_NE(is_checked.error().message.find(wrong), std::string::npos) << is_checked.error().message;
  EXPECT_FALSE(std::filesystem::exists(cache) && !std::filesystem::is_empty(cache)) << "nothing was begun";

  const auto prepared = OpenOrFail(path, options);
  const auto kept = ElevationModel::OpenFromCache({{path}}, options);
  ASSERT_TRUE(kept) << kept.error().message;
  EXPECT_EQ((*kept)->fingerprint(), prepared->fingerprint());
  options.cache = {};
  EXPECT_FALSE(ElevationModel::OpenFromCache({{path}}, options)) << "without a cache nothing is kept";
}

// By default, GDAL takes such a code for that of a successor; that of EPSG:5577 lies 2.8 degrees further east.
TEST(ElevationModel, ADeprecatedSystemIsNotReplaced) {
  const TempDir dir;
  const auto model = OpenOrFail(WriteRaster(
      dir, {.width = 32, .height = 26, .geo_transform = {500'000, 150, 0, 5'600'000, 0, -150}, .crs = "EPSG:5577"}));
  ASSERT_NE(model, nullptr);
  const RasterInfo& raster = model->info().sources.front();
  EXPECT_NE(raster.crs.find("EPSG:5577"), std::string::npos) << raster.crs;
  EXPECT_NEAR(raster.bounds.west, 20.998, 0.01);
}

}  // namespace
}  // namespace terrace::dem
