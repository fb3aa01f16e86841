#include "engine/crs/geoid.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <optional>
#include <string>

#include "tests/engine/dem/geoid_grids.h"

namespace terrace::dem {
namespace {

struct Place {
  const char* name;
  Position degrees;
};
constexpr Place kPlaces[] = {
    {"Aconcagua", {-70.0112, -32.6532}},   {"Gotthard", {8.5667, 46.5592}}, {"Haleakala", {-156.2533, 20.7097}},
    {"Mount Everest", {86.925, 27.9881}},  {"Male", {73.5093, 4.1755}},     {"Reykjavik", {-21.8174, 64.1265}},
    {"Suva", {178.4419, -18.1416}},        {"Amchitka", {179.0, 51.5}},     {"South Pole", {0, -90}},
    {"Port Moresby", {147.1803, -9.4438}},
};

// The undulation there by PROJ's cs2cs.
std::optional<double> Cs2cs(const std::string& from, Position place) {
  const std::string command = fmt::format("echo '{:.10f} {:.10f} 0' | PROJ_NETWORK=OFF cs2cs -f %.6f {} EPSG:4979 2>&1",
                                          place.y, place.x, from);
  FILE* pipe = ::popen(command.c_str(), "r");
  if (pipe == nullptr) return std::nullopt;
  double latitude = 0, longitude = 0, height = 0;
  const int found = std::fscanf(pipe, "%lf %lf %lf", &latitude, &longitude, &height);
  ::pclose(pipe);
  return found == 3 ? std::optional(height) : std::nullopt;
}

TEST(Covers, LongitudesATurnApartAreOnePlace) {
  const geo::GeoBounds earth, fiji{176, -20, -178, -12}, alps{5, 43, 17, 49};
  for (const double turn : {-360.0, 0.0, 360.0}) {
    EXPECT_TRUE(Covers(earth, {190 + turn, 10}));
    EXPECT_TRUE(Covers(fiji, {179 + turn, -15}) && Covers(fiji, {-179 + turn, -15}));
    EXPECT_FALSE(Covers(fiji, {170 + turn, -15}) || Covers(fiji, {179 + turn, -25}));
    EXPECT_TRUE(Covers(alps, {8 + turn, 46}));
    EXPECT_FALSE(Covers(alps, {18 + turn, 46}));
  }
}

// No other test uses this text, because the first query for a text determines the operation.
TEST(Geoid, IsFoundForACentreBeyondTheAntimeridian) {
  const auto beyond = Geoid::OfCrs("EPSG:4326+5773", {190, 20});
  ASSERT_TRUE(beyond) << beyond.error().message;
  EXPECT_EQ((*beyond)->Undulation({190, 20}), (*beyond)->Undulation({-170, 20}));
}

// The centre of a raster from 0 to 360 degrees, up to rounding. No other test uses this text.
TEST(Geoid, IsFoundForACentreJustBeforeTheAntimeridian) {
  const auto geoid = Geoid::OfCrs("EPSG:9707", {std::nextafter(180.0, 0.0), 20});
  EXPECT_TRUE(geoid) << geoid.error().message;
}

TEST(Geoid, Egm96EqualsCs2csAtNamedPlaces) {
  for (const auto& [name, degrees] : kPlaces) {
    const auto geoid = Geoid::OfCrs("EPSG:5773", degrees);
    ASSERT_TRUE(geoid) << geoid.error().message;
    const auto expected = Cs2cs("EPSG:4326+5773", degrees);
    ASSERT_TRUE(expected) << "cs2cs of the package proj-bin does not run";
    EXPECT_GT(std::abs(*expected), 1) << name << ": no conversion at all";
    EXPECT_NEAR((*geoid)->Undulation(degrees), *expected, 1e-4) << name;
    EXPECT_EQ((*geoid)->name(), "EGM96 height");
    ASSERT_EQ((*geoid)->files().size(), 1u);
  }
}

TEST(Geoid, IsTheSameATurnApart) {
  const auto geoid = Geoid::OfCrs("EPSG:5773", {0, 0});
  ASSERT_TRUE(geoid);
  for (const double longitude : {-180.0, -179.875, 12.3125, 179.5}) {
    EXPECT_EQ((*geoid)->Undulation({longitude, 51.0625}), (*geoid)->Undulation({longitude + 360, 51.0625}));
  }
  EXPECT_EQ((*geoid)->Undulation({180, 7}), (*geoid)->Undulation({-180, 7}));
}

TEST(Geoid, TakesTheVerticalPartOfACompoundCrs) {
  const auto geoid = Geoid::OfCrs("EPSG:4326+5773", {8, 46});
  ASSERT_TRUE(geoid) << geoid.error().message;
  EXPECT_NEAR((*geoid)->Undulation({8.5667, 46.5592}), *Cs2cs("EPSG:4326+5773", {8.5667, 46.5592}), 1e-4);
}

TEST(Geoid, SaysWhichGridIsMissingAndWhereToGetIt) {
  const auto geoid = Geoid::OfCrs("EPSG:3855", {8, 46});
  if (geoid) GTEST_SKIP() << "SKIPPED: the grid of EGM2008 is installed here";
  EXPECT_NE(geoid.error().message.find("us_nga_egm08_25.tif is not installed: get https://cdn.proj.org/"),
            std::string::npos)
      << geoid.error().message;
  EXPECT_NE(geoid.error().message.find("PROJ_DATA"), std::string::npos) << geoid.error().message;
}

TEST(Geoid, RefusesWhatIsNoHeightSystem) {
  EXPECT_NE(Geoid::OfCrs("EPSG:4326", {0, 0}).error().message.find("no vertical reference system"), std::string::npos);
  EXPECT_NE(Geoid::OfCrs("EPSG:123456", {0, 0}).error().message.find("no vertical reference system"),
            std::string::npos);
  EXPECT_FALSE(Geoid::OfCrs("EPSG:5705", {40, 50})) << "Baltic heights: PROJ knows no way";
}

TEST(Geoid, ReadsAGridFile) {
  const TempDir dir;
  const std::string path = WriteGtx(
      dir, "my own.gtx", {.value = [](int column, int row) { return static_cast<float>(40 + column + 2 * row); }});
  const auto geoid = Geoid::OfGrid(path, {8, 46});
  ASSERT_TRUE(geoid) << geoid.error().message;
  EXPECT_NEAR((*geoid)->Undulation({8, 46}), 40 + 10 + 20, 1e-6);
  EXPECT_NEAR((*geoid)->Undulation({8.05, 46.05}), 40 + 10.5 + 21, 1e-6);
  EXPECT_TRUE(std::isnan((*geoid)->Undulation({20, 46})));
}

TEST(Geoid, RefusesGridFilesWithTheReason) {
  const TempDir dir;
  const std::string path = WriteGtx(dir, "grid.gtx", {.value = [](int, int) { return 1.0f; }});
  EXPECT_NE(Geoid::OfGrid(path, {20, 46}).error().message.find("not known at the centre"), std::string::npos);
  EXPECT_NE(Geoid::OfGrid(dir.File("none.gtx"), {8, 46}).error().message.find("is no file"), std::string::npos);
  std::ofstream(dir.File("text.gtx")) << "This is no grid.";
  EXPECT_NE(Geoid::OfGrid(dir.File("text.gtx"), {8, 46}).error().message.find("cannot read"), std::string::npos);
  std::ofstream(dir.File("a,b.gtx")) << "x";
  EXPECT_NE(Geoid::OfGrid(dir.File("a,b.gtx"), {8, 46}).error().message.find("rename"), std::string::npos);
  const std::string heights = WriteGtx(dir, "heights.gtx", {.value = [](int, int) { return 467.0f; }});
  const std::string message = Geoid::OfGrid(heights, {8, 46}).error().message;
  EXPECT_NE(message.find("is 467 m; undulations are"), std::string::npos) << message;
}

// The undulations of a grid have kinks at its lines, here as strong as the strongest of EGM96.
TEST(Geoid, HasItsLinesInTheSurfaceOfSight) {
  const TempDir dir;
  const std::string geoid =
      WriteGtx(dir, "kinks.gtx", {.west = 9.5, .south = 44.5, .step = 0.25, .value = [](int column, int row) {
                                    return 3.9f * static_cast<float>(column % 2 + row % 2);
                                  }});
  DemOptions options;
  options.source.vertical = geoid;
  const auto model = OpenOrFail(
      WriteRaster(dir, {.width = 300, .height = 300, .geo_transform = {9.96, 1 / 3600.0, 0, 45.29, 0, -1 / 3600.0}}),
      options);
  ASSERT_NE(model, nullptr);
  std::vector<GeoPosition> points;
  for (int i = 0; i < 400; ++i) points.push_back({9.9985 + i * 1e-5, 45.2485 + i % 37 * 1e-4});
  const auto ground = model->ReadPoints(points);
  ASSERT_TRUE(ground);
  std::vector<SightRay> rays;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto [longitude, latitude] = points[i];
    rays.push_back({{longitude, latitude, (*ground)[i]}, {longitude, latitude, (*ground)[i] + 100}});
  }
  const auto answers = model->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  // Between two samples, the surface of sight is linear across a kink.
  for (std::size_t i = 0; i < rays.size(); ++i) EXPECT_NEAR((*answers)[i].clearance_m, 0, 3e-3) << i;
}

}  // namespace
}  // namespace terrace::dem
