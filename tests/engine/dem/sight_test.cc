// Lines of sight against a march along each ray in steps of a tenth of a pixel.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <random>

#include "engine/geo/ellipsoid.h"
#include "engine/sight/grid_sight.h"
#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

struct Marched {
  bool is_blocked = false;
  double clearance_m = std::numeric_limits<double>::infinity();
  double lowest_at = 0;
  double blocked_at = 2;  // share of the first step below the ground
};

// Reads the ground under `steps` + 1 places of each ray.
std::vector<Marched> March(const ElevationModel& model, const std::vector<SightRay>& rays, double step_m,
                           const SightOptions& options) {
  std::vector<Marched> marched;
  for (const SightRay& ray : rays) {
    const int steps = std::max(1, static_cast<int>(std::ceil(LengthOf(ray) / step_m)));
    std::vector<GeoPosition> places;
    std::vector<double> heights_m;
    for (int i = 0; i <= steps; ++i) {
      const SightPoint at = PointAt(ray, static_cast<double>(i) / steps, options);
      places.push_back({at.longitude, at.latitude});
      heights_m.push_back(at.height_m);
    }
    const auto ground = model.ReadPoints(places);
    EXPECT_TRUE(ground);
    Marched& one = marched.emplace_back();
    for (int i = 0; i <= steps; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double clearance_m = heights_m[k] - (*ground)[k];
      if (std::isnan(clearance_m)) continue;
      if (clearance_m < one.clearance_m) one.lowest_at = static_cast<double>(i) / steps;
      one.clearance_m = std::min(one.clearance_m, clearance_m);
      if (clearance_m < -kSightTolerance) one.blocked_at = std::min(one.blocked_at, static_cast<double>(i) / steps);
    }
    one.is_blocked = one.blocked_at <= 1;
  }
  return marched;
}

struct Region {
  double west, south, east, north;
  double reach_degrees;  // of rays
  double step_m;         // a tenth of a pixel
};

// Rays that begin and end some metres above the ground, some of them below it.
std::vector<SightRay> RaysIn(const ElevationModel& model, const Region& area, std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  const auto between = [&](double low, double high) {
    return low + (high - low) * std::uniform_real_distribution<double>()(random);
  };
  std::vector<GeoPosition> ends;
  for (std::size_t i = 0; i < count; ++i) {
    ends.push_back({between(area.west, area.east), between(area.south, area.north)});
    ends.push_back({std::clamp(ends.back().longitude + between(-1, 1) * area.reach_degrees, area.west, area.east),
                    std::clamp(ends.back().latitude + between(-1, 1) * area.reach_degrees, area.south, area.north)});
  }
  const auto ground = model.ReadPoints(ends);
  EXPECT_TRUE(ground);
  std::vector<SightRay> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const auto end = [&](std::size_t k) {
      const double base = std::isnan((*ground)[k]) ? 0 : (*ground)[k];
      return SightPoint{ends[k].longitude, ends[k].latitude, base + between(-2, 120)};
    };
    rays.push_back({end(2 * i), end(2 * i + 1)});
  }
  return rays;
}

// TERRACE_LONG_TESTS=1 takes ten times as many rays.
std::size_t Rays(std::size_t count) {
  const char* const is_long = std::getenv("TERRACE_LONG_TESTS");
  return is_long != nullptr && *is_long == '1' ? 10 * count : count;
}

void ExpectAsMarched(const ElevationModel& model, const Region& area, std::size_t count,
                     const SightOptions& options = {}) {
  const std::vector<SightRay> rays = RaysIn(model, area, count, 7);
  const auto answers = model.LookAlong(rays, options);
  ASSERT_TRUE(answers) << answers.error().message;
  const std::vector<Marched> marched = March(model, rays, area.step_m, options);
  std::size_t blocked = 0, close = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const SightAnswer& answer = (*answers)[i];
    const double length_m = LengthOf(rays[i]);
    blocked += answer.is_visible ? 0 : 1;
    EXPECT_EQ(std::isnan(answer.clearance_m), std::isinf(marched[i].clearance_m)) << i;
    if (std::isnan(answer.clearance_m)) continue;
    // The march may miss the lowest place by half a step; the ground is at most as steep as this.
    constexpr double kSteepest = 3;
    EXPECT_LE(answer.clearance_m, marched[i].clearance_m + 2e-3) << i;
    EXPECT_GE(answer.clearance_m, marched[i].clearance_m - kSteepest * area.step_m - 2e-3) << i;
    if (std::abs(answer.clearance_m) < 0.01) {
      ++close;
      continue;
    }
    // A ray that passes below the ground between two steps alone.
    const bool is_between = !answer.is_visible && answer.clearance_m > -kSteepest * area.step_m;
    if (!is_between) {
      EXPECT_EQ(answer.is_visible, !marched[i].is_blocked) << i << " by " << answer.clearance_m;
    }
    if (answer.is_visible || !marched[i].is_blocked) continue;
    ASSERT_TRUE(answer.blocked_at);
    EXPECT_LE(*answer.blocked_at * length_m, marched[i].blocked_at * length_m + 1e-3) << i;
  }
  std::printf("%zu rays, %zu blocked, %zu within 1 cm\n", count, blocked, close);
  EXPECT_GT(blocked, count / 10);
  EXPECT_LT(blocked, count - count / 10);
  EXPECT_LT(close, count / 50);
}

RasterSpec Hills() {
  RasterSpec spec{.width = 700, .height = 600, .geo_transform = {10, .001, 0, 46, 0, -.001}, .nodata = -9999};
  spec.value = [](int col, int row) {
    const bool is_void = col > 100 && col < 220 && row > 100 && row < 240;
    return is_void ? -9999.0 : 800 + 300 * std::sin(col / 9.0) * std::cos(row / 7.0) + (col * 7 + row * 13) % 31;
  };
  return spec;
}

TEST(Sight, IsThatOfAMarchOverHillsAndAHole) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, Hills()));
  ASSERT_TRUE(source);
  ExpectAsMarched(*source, {10.02, 45.42, 10.68, 45.98, .06, 8}, Rays(600));
}

TEST(Sight, IsThatOfAMarchOverRealMountains) {
  TERRACE_REQUIRE_DATA(path, "srtm3_N46E008_swiss_alps.tif");
  DemOptions options;
  options.source.vertical = "egm96";
  const auto source = OpenOrFail(path, options);
  ASSERT_TRUE(source);
  ExpectAsMarched(*source, {8.05, 46.05, 8.95, 46.95, .06, 7}, Rays(1000), {.refraction = 0.13});
}

TEST(Sight, IsThatOfAMarchOverAProjectedRaster) {
  TERRACE_REQUIRE_DATA(path, "bigtujunga_30m_utm11.tif");
  const auto source = OpenOrFail(path);
  ASSERT_TRUE(source);
  ExpectAsMarched(*source, {-118.35, 34.25, -118.05, 34.36, .03, 3}, Rays(800));
}

TEST(Sight, IsThatOfAMarchOverAMosaic) {
  const TempDir dir;
  RasterSpec fine = Hills();
  RasterSpec coarse{.width = 60, .height = 60, .geo_transform = {9.9, .02, 0, 46.2, 0, -.02}, .nodata = -9999};
  coarse.value = [](int col, int row) { return 900 + 100 * std::sin(col / 2.0) + 80 * std::cos(row / 3.0); };
  const auto source = OpenOrFail({{.path = WriteRaster(dir, fine, "fine.tif"), .rank = 0},
                                  {.path = WriteRaster(dir, coarse, "coarse.tif"), .rank = 1}});
  ASSERT_TRUE(source);
  // Where sources meet, the ground jumps by hundreds of metres: the march finds the edge within a step.
  const std::vector<SightRay> rays = RaysIn(*source, {9.95, 45.3, 10.8, 46.1, .06, 8}, 300, 3);
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  const std::vector<Marched> marched = March(*source, rays, 8, {});
  std::size_t blocked = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    blocked += marched[i].is_blocked ? 1 : 0;
    EXPECT_LE((*answers)[i].clearance_m, marched[i].clearance_m + 2e-3)
        << i << " from " << rays[i].from.longitude << ' ' << rays[i].from.latitude << " to " << rays[i].to.longitude
        << ' ' << rays[i].to.latitude << " marched lowest at " << marched[i].lowest_at;
    const bool is_visible = (*answers)[i].is_visible;
    EXPECT_FALSE(marched[i].is_blocked && is_visible) << i;
    EXPECT_FALSE(marched[i].clearance_m > 30 && !is_visible) << i;
    EXPECT_FALSE((*answers)[i].has_gaps);
  }
  EXPECT_GT(blocked, 30u);
}

TEST(Sight, FollowsTheEarthsCurvature) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, FlatSquare(0, 2, 200, .01, 0)));
  ASSERT_TRUE(source);
  // Half way, a ray of 2a lies a^2 / 2R below its ends: 100 km sag by 196 m.
  const double half_m = 50'000, radius_m = 6'378'000, sag_m = half_m * half_m / (2 * radius_m);
  const double degrees = half_m / geo::MetresPerDegreeEast(0.5);
  const auto clearance = [&](double height_m, double refraction) {
    const std::vector<SightRay> ray = {{{1 - degrees, 0.5, height_m}, {1 + degrees, 0.5, height_m}}};
    return source->LookAlong(ray, {refraction})->front();
  };
  EXPECT_NEAR(clearance(300, 0).clearance_m, 300 - sag_m, 1);
  EXPECT_TRUE(clearance(300, 0).is_visible);
  EXPECT_FALSE(clearance(190, 0).is_visible);
  EXPECT_NEAR(clearance(190, 0.13).clearance_m, 190 - 0.87 * sag_m, 1);
  EXPECT_TRUE(clearance(190, 0.13).is_visible) << "the air bends the ray over the horizon";
  // The first place below the ground: where 190 m are less than what the Earth has curved.
  const double at = 0.5 - 0.5 * std::sqrt(1 - 190 / sag_m);
  EXPECT_NEAR(*clearance(190, 0).blocked_at, at, 2e-3);
}

TEST(Sight, AnswersRaysWithoutLengthBelowTheGroundAndBesideTheData) {
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, FlatSquare(0, 2, 200, .01, 100)));
  ASSERT_TRUE(source);
  const std::vector<SightRay> rays = {
      {{1, 1, 150}, {1, 1, 150}},       // no length
      {{1, 1, 90}, {1, 1, 90}},         // no length, below the ground
      {{1, 1, 90}, {1.1, 1, 200}},      // begins below
      {{1, 1, 200}, {1.1, 1, 90}},      // ends below
      {{1, 1, 100}, {1, 1, 5000}},      // straight up from the ground
      {{40, 1, 100}, {40.1, 1, 100}},   // beside the data
      {{-0.1, 1, 200}, {0.1, 1, 200}},  // partly
      {{1, 1, 1e6}, {1.5, 1.5, 1e6}},   // in orbit
  };
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  EXPECT_NEAR((*answers)[0].clearance_m, 50, 1e-3);
  EXPECT_TRUE((*answers)[0].is_visible);
  EXPECT_NEAR((*answers)[1].clearance_m, -10, 1e-3);
  EXPECT_FALSE((*answers)[1].is_visible);
  EXPECT_EQ((*answers)[2].blocked_at, 0);
  EXPECT_FALSE((*answers)[3].is_visible);
  EXPECT_NEAR(*(*answers)[3].blocked_at, (100.0 - 1) / 110, 3e-3) << "1 m of them by the curvature";
  EXPECT_TRUE((*answers)[4].is_visible) << "on the ground";
  EXPECT_TRUE(std::isnan((*answers)[5].clearance_m));
  EXPECT_TRUE((*answers)[5].has_gaps);
  EXPECT_TRUE((*answers)[6].has_gaps);
  EXPECT_NEAR((*answers)[6].clearance_m, 100, 50);
  EXPECT_TRUE((*answers)[7].is_visible);
  EXPECT_GT((*answers)[7].clearance_m, 9.9e5);
}

TEST(Sight, CrossesTheAntimeridianOfARasterAroundTheEarth) {
  const TempDir dir;
  RasterSpec spec{.width = 360, .height = 180, .geo_transform = {-180, 1, 0, 90, 0, -1}};
  spec.value = [](int col, int) { return col == 0 || col == 359 ? 2000.0 : 0.0; };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_TRUE(source);
  const std::vector<SightRay> rays = {{{178, 0.5, 1000}, {-178, 0.5, 1000}}, {{178, 0.5, 9000}, {-178, 0.5, 9000}}};
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  EXPECT_FALSE((*answers)[0].is_visible);
  // 222 km sag by 3.9 km.
  EXPECT_NEAR((*answers)[1].clearance_m, 9000 - 2000 - 3863, 60);
}

// 0 but for smooth hills, and for mountains at longitude 0: a ray across the antimeridian does not see them.
RasterSpec HillsAroundTheEarth(const std::string& crs, double half_width, double half_height) {
  RasterSpec spec{.width = 1200, .height = 600};
  spec.geo_transform = {-half_width, half_width / 600, 0, half_height, 0, -half_height / 300};
  spec.crs = crs;
  spec.value = [](int col, int row) {
    return std::abs(col - 599.5) < 30 ? 5000 : 300 * std::sin(col / 9.0) * std::cos(row / 7.0);
  };
  return spec;
}

void ExpectAsMarchedAcrossTheAntimeridian(const RasterSpec& spec) {
  SCOPED_TRACE(spec.crs);
  const TempDir dir;
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_TRUE(source);
  std::vector<SightRay> rays;
  for (int i = 0; i < 40; ++i) {
    const double latitude = -70 + 3.5 * i;
    rays.push_back({{179.4 + 0.013 * i, latitude, 500}, {-179.6 + 0.011 * i, latitude + 0.1, 800}});
    if (i % 2 == 1) std::swap(rays.back().from, rays.back().to);
  }
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers) << answers.error().message;
  const std::vector<Marched> marched = March(*source, rays, 100, {});
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_NEAR((*answers)[i].clearance_m, marched[i].clearance_m, 1) << rays[i].from.latitude;
    EXPECT_EQ((*answers)[i].is_visible, !marched[i].is_blocked) << rays[i].from.latitude;
    EXPECT_FALSE((*answers)[i].has_gaps) << rays[i].from.latitude;
  }
}

TEST(Sight, CrossesTheAntimeridianOfProjectedRasters) {
  constexpr double kHalfTurn = 20037508.342789244, kRootOf2 = 1.4142135623730951, kMajor = 6378137;
  ExpectAsMarchedAcrossTheAntimeridian(HillsAroundTheEarth("EPSG:3857", kHalfTurn, kHalfTurn));
  ExpectAsMarchedAcrossTheAntimeridian(HillsAroundTheEarth("+proj=eqc +datum=WGS84", kHalfTurn, kHalfTurn / 2));
  ExpectAsMarchedAcrossTheAntimeridian(HillsAroundTheEarth("+proj=cea +datum=WGS84", kHalfTurn, kMajor));
  ExpectAsMarchedAcrossTheAntimeridian(
      HillsAroundTheEarth("+proj=moll +datum=WGS84", 2 * kRootOf2 * kMajor, kRootOf2 * kMajor));
}

// Its columns do not wrap, and the gap is shorter than a piece of a ray.
TEST(Sight, SeesBothSidesOfANarrowGapInARasterAroundTheEarth) {
  const TempDir dir;
  RasterSpec spec{.width = 35999, .height = 40, .geo_transform = {-180, 0.01, 0, 0.2, 0, -0.01}};
  spec.value = [](int col, int) { return col == 0 || col == 35998 ? 300.0 : 0.0; };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_TRUE(source);
  const std::vector<SightRay> rays = {{{179.987, 0.1, 200}, {-179.997, 0.1, 350}},
                                      {{179.987, 0.1, 350}, {-179.997, 0.1, 200}}};
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  for (const SightAnswer& answer : *answers) {
    EXPECT_NEAR(answer.clearance_m, -100, 10);
    EXPECT_TRUE(answer.has_gaps);
  }
}

TEST(Sight, SeesTheGroundUpToTheEdgeOfTheProjection) {
  const TempDir dir;
  RasterSpec spec{.width = 512, .height = 512, .geo_transform = {-6.4e6, 25e3, 0, 6.4e6, 0, -25e3}};
  spec.crs = "+proj=ortho +lat_0=0 +lon_0=0 +a=6378137 +b=6378137";
  spec.value = [](int, int) { return 100.0; };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_TRUE(source);
  const std::vector<SightRay> rays = {{{89.95, 0.1, 300}, {90.01, 0.1, 350}}, {{90.01, 0.1, 350}, {89.95, 0.1, 300}}};
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  for (const SightAnswer& answer : *answers) {
    EXPECT_NEAR(answer.clearance_m, 200, 1);
    EXPECT_TRUE(answer.has_gaps);
  }
}

// Cells with some voids, of several kilometres: a ray may touch the ground between two places that are measured.
TEST(Sight, FindsTheLowestAndTheFirstPlaceBesideVoids) {
  const TempDir dir;
  RasterSpec spec{.width = 60, .height = 60, .geo_transform = {10, .08, 0, 48, 0, -.08}, .nodata = -9999};
  spec.value = [](int col, int row) {
    const unsigned mixed = static_cast<unsigned>(col * 73 + row * 151 + col * row * 29) * 2654435761u >> 16;
    return mixed % 3 == 0 ? -9999.0 : static_cast<double>(mixed % 300);
  };
  DemOptions options;
  options.max_void_gap = 0;
  const auto source = OpenOrFail(WriteRaster(dir, spec), options);
  ASSERT_TRUE(source);
  const Region area{10.1, 43.3, 14.7, 47.9, .2, 20};
  const std::vector<SightRay> rays = RaysIn(*source, area, Rays(400), 11);
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  const std::vector<Marched> marched = March(*source, rays, area.step_m, {});
  std::size_t blocked = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const SightAnswer& answer = (*answers)[i];
    if (std::isnan(answer.clearance_m)) continue;
    EXPECT_LE(answer.clearance_m, marched[i].clearance_m + 0.01) << i;
    EXPECT_FALSE(marched[i].is_blocked && answer.is_visible) << i;
    if (!marched[i].is_blocked || answer.is_visible) continue;
    ++blocked;
    const double length_m = LengthOf(rays[i]);
    EXPECT_LE(*answer.blocked_at * length_m, marched[i].blocked_at * length_m + 1e-3) << i;
    // It is above the ground right before, and below it right behind. Between two cells the ground may jump.
    std::array<double, 2> clearance_m{};
    for (const std::size_t side : {std::size_t{0}, std::size_t{1}}) {
      const double share = std::clamp(*answer.blocked_at + (side == 0 ? -1e-6 : 1e-6), 0.0, 1.0);
      const SightPoint there = PointAt(rays[i], share, {});
      const std::vector<GeoPosition> place = {{there.longitude, there.latitude}};
      clearance_m[side] = there.height_m - source->ReadPoints(place)->front();
    }
    if (*answer.blocked_at > 0 && !std::isnan(clearance_m[0])) {
      EXPECT_GT(clearance_m[0], -0.01) << i;
    }
    EXPECT_LT(clearance_m[1], 0.01) << i;
  }
  EXPECT_GT(blocked, rays.size() / 10);
}

// Beyond the outermost samples, rows have the heights of the rim: there a void is a single place on a ray.
TEST(Sight, DoesNotSeeTheGroundBelowThroughAVoidOfTheRim) {
  const TempDir dir;
  RasterSpec top{.width = 60, .height = 60, .geo_transform = {10, .01, 0, 46, 0, -.01}};
  top.nodata = -9999;
  top.value = [](int col, int row) { return col == 59 && row == 30 ? -9999.0 : 10.0; };
  RasterSpec below{.width = 60, .height = 60, .geo_transform = {9.99, .011, 0, 46.01, 0, -.011}};
  below.value = [](int, int) { return 5000.0; };
  const std::vector<DemFile> files = {{WriteRaster(dir, top, "top.tif")}, {WriteRaster(dir, below, "below.tif")}};
  const std::vector<SightRay> rays = {{{10.598, 45.642, 400}, {10.598, 45.748, 400}}};
  for (const std::size_t count : {1, 2}) {
    const auto source = OpenOrFail(std::vector<DemFile>(files.begin(), files.begin() + count), {.max_void_gap = 0});
    ASSERT_TRUE(source);
    const auto answers = source->LookAlong(rays, {});
    ASSERT_TRUE(answers);
    EXPECT_TRUE(answers->front().is_visible);
    EXPECT_NEAR(answers->front().clearance_m, 387.3, 1);
    EXPECT_FALSE(answers->front().has_gaps);
  }
}

// Longitudes of rays that pass near a pole are far from linear there, whatever the latitudes of their ends.
TEST(Sight, IsThatOfAMarchPastAPole) {
  const TempDir dir;
  RasterSpec spec{.width = 720, .height = 200, .geo_transform = {-180, .5, 0, 90, 0, -.005}};
  spec.value = [](int column, int row) {
    const double from_pole_m = std::min((row + .5) * .005 * 111'694, 5000.0);
    return 1000 + 0.3 * from_pole_m * std::sin(geo::ToRadians(column * .5 - 179.75));
  };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_TRUE(source);
  std::vector<SightRay> rays;
  for (const double turn : {0.0, 3.0, 40.0, 90.0, 133.0}) {
    for (const double across : {180.0, 179.0, 160.0}) {
      rays.push_back({{turn, 89.6, 1900}, {std::remainder(turn + across, 360), 89.75, 1950}});
    }
  }
  constexpr double kStep = 1;
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  const std::vector<Marched> marched = March(*source, rays, kStep, {});
  std::size_t blocked = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    EXPECT_EQ((*answers)[i].is_visible, !marched[i].is_blocked) << i;
    EXPECT_LE((*answers)[i].clearance_m, marched[i].clearance_m + 0.01) << i;
    EXPECT_GE((*answers)[i].clearance_m, marched[i].clearance_m - kStep) << i;
    blocked += marched[i].is_blocked ? 1 : 0;
  }
  EXPECT_GT(blocked, 1u);
  EXPECT_LT(blocked, rays.size());
}

// Rasters of one grid with a gap of ten columns between them, as narrow as the voids that are filled in a raster.
TEST(Sight, SeesTheRasterBelowInANarrowGapBetweenRasters) {
  const TempDir dir;
  constexpr double kStep = 0.001;
  std::vector<DemFile> files;
  const auto add = [&](const char* name, int column, int width, int height) {
    RasterSpec spec{.width = width, .height = height, .geo_transform = {10 + column * kStep, kStep, 0, 46, 0, -kStep}};
    spec.value = [](int, int) { return 1000.0; };
    files.push_back({WriteRaster(dir, spec, name)});
  };
  add("west.tif", 0, 40, 60);
  add("east.tif", 50, 40, 60);
  add("between.tif", 40, 10, 20);
  RasterSpec below{.width = 60, .height = 60, .geo_transform = {9.99, .002, 0, 46.01, 0, -.002}};
  below.value = [](int, int) { return 10.0; };
  files.push_back({WriteRaster(dir, below, "below.tif")});
  const auto source = OpenOrFail(files);
  ASSERT_TRUE(source);
  const double y = 46 - 45 * kStep;
  const std::vector<GeoPosition> places = {{10 + 39.9 * kStep, y}, {10 + 40.1 * kStep, y}, {10 + 49.9 * kStep, y}};
  const auto heights = source->ReadPoints(places);
  ASSERT_TRUE(heights);
  EXPECT_EQ(*heights, (std::vector<float>{1000, 10, 10}));
  const std::vector<SightRay> rays = {{{10 + 41 * kStep, y, 500}, {10 + 49 * kStep, y, 500}},
                                      {{10 + 41 * kStep, y, 500}, {10 + 51 * kStep, y, 500}}};
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  EXPECT_TRUE((*answers)[0].is_visible);
  EXPECT_NEAR((*answers)[0].clearance_m, 490, 1);
  EXPECT_FALSE((*answers)[0].has_gaps);
  EXPECT_FALSE((*answers)[1].is_visible);
  EXPECT_NEAR(*(*answers)[1].blocked_at, 0.9, 0.01);
}

// The lowest place is the end of the ray, where it meets the ground.
TEST(Sight, TellsTheEndOfARayAsItsLowestPlace) {
  const TempDir dir;
  RasterSpec spec{.width = 200, .height = 200, .geo_transform = {7, 1.0 / 3600, 0, 46, 0, -1.0 / 3600}};
  std::mt19937 random(1);
  std::uniform_real_distribution<double> height(0, 1), share(0.02, 0.98);
  spec.value = [&](int, int) { return height(random); };
  const auto source = OpenOrFail(WriteRaster(dir, spec));
  ASSERT_TRUE(source);
  const auto place = [&] { return GeoPosition{7 + share(random) / 18, 46 - share(random) / 18}; };
  std::vector<SightRay> rays;
  for (int i = 0; i < 500; ++i) {
    const std::array<GeoPosition, 2> ends = {place(), place()};
    const auto ground = source->ReadPoints(ends);
    ASSERT_TRUE(ground);
    rays.push_back({{ends[0].longitude, ends[0].latitude, (*ground)[0] + 300.0},
                    {ends[1].longitude, ends[1].latitude, double{(*ground)[1]}}});
  }
  const auto answers = source->LookAlong(rays, {});
  ASSERT_TRUE(answers);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const SightAnswer& answer = (*answers)[i];
    const SightPoint lowest = PointAt(rays[i], answer.clearance_at, {});
    ASSERT_GE(answer.clearance_at, 0);
    ASSERT_LE(answer.clearance_at, 1);
    const auto ground = source->ReadPoints(std::array{GeoPosition{lowest.longitude, lowest.latitude}});
    ASSERT_TRUE(ground);
    EXPECT_NEAR(lowest.height_m - double{ground->front()}, answer.clearance_m, 0.01) << i;
  }
}

}  // namespace
}  // namespace terrace::dem
