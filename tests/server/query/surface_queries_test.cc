// Requests for heights as numbers, surfaces, grids and lines of sight.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "engine/core/bytes.h"
#include "server/query/grid_query.h"
#include "server/query/heights_query.h"
#include "server/query/sight_query.h"

namespace terrace::server {
namespace {

constexpr const char* kBinary = "application/octet-stream";
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();

std::string BytesOf(const std::vector<double>& numbers) {
  ByteWriter writer;
  for (const double number : numbers) writer.Put(number);
  return writer.Take();
}

template <typename T>
void ExpectSays(const Result<T>& parsed, const char* says) {
  ASSERT_FALSE(parsed) << says;
  EXPECT_EQ(parsed.error().code, ErrorCode::kInvalidArgument);
  EXPECT_NE(parsed.error().message.find(says), std::string::npos) << parsed.error().message;
}

TEST(BinaryHeights, ReadsLongitudeBeforeLatitude) {
  const std::string body = BytesOf({8.25, 46.5, -180, -90, 180, 90});
  const auto query = ParseHeights({"normals=1", kBinary, body}, 3);
  ASSERT_TRUE(query) << query.error().message;
  EXPECT_TRUE(query->is_binary);
  EXPECT_TRUE(query->wants_normals);
  ASSERT_EQ(query->points.size(), 3u);
  EXPECT_EQ(query->points[0].longitude, 8.25);
  EXPECT_EQ(query->points[0].latitude, 46.5);
  EXPECT_EQ(query->points[2].latitude, 90);
}

TEST(BinaryHeights, SaysWhatIsWrong) {
  const auto parse = [](const std::string& body, const char* query = "") {
    return ParseHeights({query, kBinary, body}, 2);
  };
  const std::string point = BytesOf({8, 46});
  ExpectSays(parse(""), "0 bytes, which is no multiple of 16");
  ExpectSays(parse(point + "x"), "17 bytes, which is no multiple of 16");
  ExpectSays(parse(point.substr(1)), "15 bytes");
  ExpectSays(parse(point + point + point), "more than 2 points");
  ExpectSays(parse(point + BytesOf({kNaN, 0})), "byte 16: point 2: the longitude must be");
  ExpectSays(parse(point + BytesOf({0, kNaN})), "byte 24: point 2: the latitude must be");
  ExpectSays(parse(BytesOf({kInfinity, 0})), "the longitude must be");
  ExpectSays(parse(BytesOf({0, -kInfinity})), "the latitude must be");
  ExpectSays(parse(BytesOf({46.5, 98.25})), "the longitude comes first");
  ExpectSays(parse(point, "locations=1,2"), "exclude a body of points");
  ExpectSays(parse(point, "step=abc"), "step and samples need path");
  ExpectSays(parse(point, "certify=deepest"), "certify needs a reply in JSON");
  ExpectSays(parse(point, "normals=yes"), "normals must be 0 or 1");
}

// curl and urllib send this type unless told otherwise.
TEST(BinaryHeights, AreNamedIfTheyAreSentAsAForm) {
  constexpr const char* kForm = "application/x-www-form-urlencoded";
  constexpr const char* kRemedy = "send numbers with Content-Type: application/octet-stream";
  ExpectSays(ParseHeights({{}, kForm, BytesOf({8.25, 46.5})}, 9), kRemedy);
  ExpectSays(ParseSight({{}, kForm, BytesOf({8.25, 46.5, 900, 8.5, 46.5, 900})}, 9), kRemedy);
  for (const char* text : {"location=46.5,8.25", "locations=46.5;8.25\r\n"}) {
    const auto refused = ParseHeights({{}, kForm, text}, 9);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().message.find("octet-stream"), std::string::npos) << refused.error().message;
  }
}

TEST(DrawnSurface, ReadsTheParametersOfTiles) {
  const auto query = ParseHeights(
      {"locations=1,2&surface=served&level=12&error=5&atleast=1&format=glb&compression=meshopt", {}, {}}, 9);
  ASSERT_TRUE(query) << query.error().message;
  ASSERT_TRUE(query->drawn);
  EXPECT_EQ(query->drawn->level, 12);
  EXPECT_EQ(query->drawn->requested.error_m, 5);
  EXPECT_TRUE(query->drawn->requested.at_least);
  EXPECT_EQ(query->drawn->format, tiler::TileFormat::kGlb);
  EXPECT_EQ(query->drawn->compression, proto::GlbCompression::kMeshopt);
  EXPECT_FALSE(ParseHeights({"locations=1,2&surface=served&format=glb", {}, {}}, 9)->drawn->compression)
      << "the dataset's";
  EXPECT_FALSE(ParseHeights({"locations=1,2&surface=source", {}, {}}, 9)->drawn);
  EXPECT_TRUE(ParseHeights({"locations=1,2&surface=served&atleast=0", {}, {}}, 9)) << "as on URLs of tiles";
}

TEST(DrawnSurface, SaysWhatIsWrong) {
  const struct {
    const char* query;
    const char* says;
  } cases[] = {
      {"surface=mesh", "surface must be source or served"},
      {"level=3", "level needs surface=served"},
      {"error=3", "error needs surface=served"},
      {"surface=source&format=glb", "format needs surface=served"},
      {"compression=none", "compression needs surface=served"},
      {"surface=served&level=25", "level must be"},
      {"surface=served&level=-1", "level must be"},
      {"surface=served&level=", "level must be"},
      {"surface=served&error=0", "error must be"},
      {"surface=served&error=nan", "error must be"},
      {"surface=served&fraction=-1", "fraction must be"},
      {"surface=served&error=1&fraction=1", "exclude each other"},
      {"surface=served&atleast=1", "atleast needs error"},
      {"surface=served&error=1&atleast=2", "atleast must be"},
      {"surface=served&format=obj", "format must be terrain or glb"},
      {"surface=served&compression=draco", "compression needs format=glb"},
      {"surface=served&format=glb&compression=zip", "compression must be"},
      {"surface=served&certify=deepest", "certify is for heights of the sources"},
      {"surface=served&datum=orthometric", "ellipsoidal heights alone"},
  };
  for (const auto& [query, says] : cases) {
    ExpectSays(ParseHeights({std::string("locations=1,2&") + query, {}, {}}, 9), says);
  }
}

TEST(GridQuery, ReadsSizesFormatsAndRanges) {
  const auto query =
      ParseGrid("bbox=400000,3790000,401000,3791000&crs=EPSG:32611&width=505&height=505&format=r16&range=0,512&v=1");
  ASSERT_TRUE(query) << query.error().message;
  EXPECT_EQ(query->grid.epsg, 32611);
  EXPECT_EQ(query->grid.columns, 505);
  EXPECT_EQ(query->grid.north, 3791000);
  EXPECT_EQ(query->format, GridFormat::kR16);
  EXPECT_EQ(query->range->max, 512);
  EXPECT_EQ(ParseGrid("bbox=0,0,1,1&spacing=0.25")->grid.spacing, 0.25);
}

TEST(GridQuery, SaysWhatIsWrong) {
  const struct {
    const char* query;
    const char* says;
  } cases[] = {
      {"width=2&height=2", "bbox=west,south,east,north is needed"},
      {"bbox=0,0,1&width=2&height=2", "bbox=west,south,east,north is needed"},
      {"bbox=0,0,1,nan&width=2&height=2", "bbox=west,south,east,north is needed"},
      {"bbox=0,0,1,1", "width and height, or spacing"},
      {"bbox=0,0,1,1&width=2", "width and height, or spacing"},
      {"bbox=0,0,1,1&width=2&height=x", "height must be"},
      {"bbox=0,0,1,1&width=2&height=2&spacing=1", "excludes"},
      {"bbox=0,0,1,1&spacing=0", "spacing must be"},
      {"bbox=0,0,1,1&spacing=inf", "spacing must be"},
      {"bbox=0,0,1,1&spacing=1&crs=UTM11", "crs must be"},
      {"bbox=0,0,1,1&spacing=1&crs=EPSG:", "crs must be"},
      {"bbox=0,0,1,1&spacing=1&format=tiff", "format must be"},
      {"bbox=0,0,1,1&spacing=1&range=5,5&format=r16", "range must be"},
      {"bbox=0,0,1,1&spacing=1&range=-1.7e308,1.7e308&format=r16", "from -1000000 to 1000000"},
      {"bbox=0,0,1,1&spacing=1&range=-1000001,0&format=r16", "from -1000000 to 1000000"},
      {"bbox=0,0,1,1&spacing=1&range=0,1000001&format=json", "from -1000000 to 1000000"},
      {"bbox=0,0,1,1&spacing=1&range=0,5", "range needs format=r16, png16 or json"},
      {"bbox=0,0,1,1&spacing=1&format=json&fraction=0.5", "fraction needs surface=served"},
      {"bbox=0,0,1,1&spacing=1&datum=mean", "datum must be"},
      {"bbox=0,0,1,1&spacing=1&size=3", "unknown parameter"},
      {"bbox=0,0,1,1&spacing=1&spacing=1", "more than once"},
  };
  for (const auto& [query, says] : cases) ExpectSays(ParseGrid(query), says);
}

// Of all nodes of a grid with this many rows.
Result<std::vector<dem::GeoPosition>> PositionsOf(const dem::OutputGrid& grid, std::int64_t rows) {
  const auto positions = dem::GridPositions::Make(grid);
  if (!positions) return tl::unexpected(positions.error());
  return positions->OfRows(0, rows, {});
}

TEST(GridPlan, NamesLimitsAndReferenceSystems) {
  dem::GridRequest request{.west = 7, .south = 46, .east = 8, .north = 47, .columns = 3, .rows = 5};
  const auto plan = dem::PlanOutputGrid(request, 100);
  ASSERT_TRUE(plan) << plan.error().message;
  const auto positions = PositionsOf(*plan, 5);
  ASSERT_TRUE(positions);
  EXPECT_EQ(positions->front().latitude, 47);
  EXPECT_EQ(positions->front().longitude, 7);
  EXPECT_EQ((*positions)[1].longitude, 7.5);
  EXPECT_EQ(positions->back().latitude, 46);
  EXPECT_EQ(positions->back().longitude, 8);
  ExpectSays(dem::PlanOutputGrid(request, 14), "3 x 5 nodes, more than max_mesh_samples of this server (14)");
  request.columns = 0;
  ExpectSays(dem::PlanOutputGrid(request, 100), "width: a grid has at least 2 nodes");
  request.columns = 1'000'000'000;
  request.rows = 1'000'000'000;
  ExpectSays(dem::PlanOutputGrid(request, 100), "1000000000 x 1000000000 nodes");
  request.columns = request.rows = {};
  request.spacing = 1e-300;
  ExpectSays(dem::PlanOutputGrid(request, 100), "more than max_mesh_samples");
  request.spacing = 5;
  ExpectSays(dem::PlanOutputGrid(request, 100), "spacing: a grid has at least 2 nodes");
  request.spacing = 0.3;
  EXPECT_EQ(dem::PlanOutputGrid(request, 100)->columns, 4);
  EXPECT_NEAR(dem::PlanOutputGrid(request, 100)->south, 46.1, 1e-9);
  request.epsg = 99999;
  ExpectSays(dem::PlanOutputGrid(request, 100), "PROJ knows no EPSG:99999");
  request.epsg = 5773;  // EGM96 heights
  ExpectSays(dem::PlanOutputGrid(request, 100), "is no system of two axes");
  request.epsg = 4978;  // geocentric
  ExpectSays(dem::PlanOutputGrid(request, 100), "is no system of two axes");
  request.epsg = 2048;  // South Africa: axes run west and south
  ExpectSays(dem::PlanOutputGrid(request, 100), "the axes of EPSG:2048 run west or south");
  request.epsg = 4807;  // grads
  ExpectSays(dem::PlanOutputGrid(request, 100), "EPSG:4807 counts in grad");
  // Around the poles both axes run north, or south.
  for (const int polar : {3031, 3413, 5041, 32661}) {
    const auto around = dem::PlanOutputGrid({polar, 1.5e6, 1.5e6, 2.5e6, 2.5e6, 10, 10, {}}, 100);
    EXPECT_TRUE(around) << around.error().message;
  }
  // The north-eastern node lies beside the map of the Earth.
  const auto beside = dem::PlanOutputGrid({8857, 0, 0, 1.7e7, 8e6, 3, 3, {}}, 100);
  ASSERT_TRUE(beside) << beside.error().message;
  ExpectSays(PositionsOf(*beside, 3), "no place on Earth for column 2, row 0");
  // Half a million kilometres east of zone 11.
  const auto far = dem::PlanOutputGrid({32611, 5e8, 0, 6e8, 1e6, 10, 10, {}}, 100);
  ASSERT_TRUE(far) << far.error().message;
  ExpectSays(PositionsOf(*far, 10), "EPSG:32611 has no place on Earth for column 0, row 0");
}

// The half circumference is 20037508.342789: usual roundings of the box of the world reach beyond it.
TEST(GridPlan, HasTheRoundedWorldOfWebMercator) {
  for (const double half : {20037508.34, 20037508.3428, 20037508.35, 20037509.0}) {
    const auto world = dem::PlanOutputGrid({3857, -half, -half, half, half, 3, 3, {}}, 100);
    ASSERT_TRUE(world) << world.error().message;
    const auto positions = PositionsOf(*world, 3);
    ASSERT_TRUE(positions) << positions.error().message;
    EXPECT_NEAR(positions->front().longitude, -180, 2e-5);
    EXPECT_NEAR(positions->front().latitude, 85.0511288, 1e-5);
    EXPECT_NEAR(positions->back().longitude, 180, 2e-5);
    EXPECT_NEAR(positions->back().latitude, -85.0511288, 1e-5);
    EXPECT_NEAR((*positions)[4].longitude, 0, 1e-9);
  }
  const auto beyond = dem::PlanOutputGrid({3857, -20037512, 0, 0, 100, 3, 3, {}}, 100);
  ASSERT_TRUE(beyond);
  ExpectSays(PositionsOf(*beyond, 3), "no place on Earth for column 0, row 0");
}

TEST(GridPlan, TellsWhereAnAreaIsInItsReferenceSystem) {
  const auto plan = dem::PlanOutputGrid({32632, 8.03, 46.45, 8.16, 46.55, 5, 5, {}}, 100);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->unit, "metre");
  const auto box = dem::BoundsInCrs(*plan, {8, 46, 10, 47});
  ASSERT_TRUE(box);
  // By `gdaltransform -s_srs EPSG:4326 -t_srs EPSG:32632`. The southern edge is farthest south at 9 degrees.
  EXPECT_NEAR(box->west, 422567.8174, 1e-3);
  EXPECT_NEAR(box->east, 577432.1826, 1e-3);
  EXPECT_NEAR(box->south, 5094047.4921, 1e-3);
  EXPECT_NEAR(box->north, 5205649.3477, 1e-3);
  EXPECT_FALSE(dem::BoundsInCrs(*plan, {-180, -90, 180, 90})) << "zone 32 is no map of the world";
  const auto degrees = dem::PlanOutputGrid({4326, 1, 2, 3, 4, 5, 5, {}}, 100);
  ASSERT_TRUE(degrees);
  EXPECT_EQ(degrees->unit, "degree");
  EXPECT_EQ(dem::BoundsInCrs(*degrees, {8, 46, 10, 47})->east, 10);
  // Across the antimeridian: as a bbox takes it, and nothing in metres.
  const auto etrs = dem::PlanOutputGrid({4258, 1, 2, 3, 4, 5, 5, {}}, 100);
  ASSERT_TRUE(etrs);
  EXPECT_EQ(dem::BoundsInCrs(*etrs, {170, 0, -170, 10})->east, -170);
  const auto mercator = dem::PlanOutputGrid({3857, 0, 0, 1000, 1000, 5, 5, {}}, 100);
  ASSERT_TRUE(mercator);
  EXPECT_FALSE(dem::BoundsInCrs(*mercator, {170, 0, -170, 10}));
  EXPECT_FALSE(dem::BoundsInCrs(*mercator, {-180, -90, 180, 90}));
  EXPECT_NEAR(dem::BoundsInCrs(*mercator, {-180, -60, 180, 60})->east, 20037508.34, 0.01);
}

TEST(SightQuery, ReadsOneRayAndMany) {
  const auto one = ParseSight({"from=46,7,1000&to=46.1,7.1,1200.5&refraction=0.13&heights=ground", {}, {}}, 9);
  ASSERT_TRUE(one) << one.error().message;
  ASSERT_EQ(one->rays.size(), 1u);
  EXPECT_EQ(one->rays[0].from.latitude, 46);
  EXPECT_EQ(one->rays[0].to.height_m, 1200.5);
  EXPECT_EQ(one->options.refraction, 0.13);
  EXPECT_TRUE(one->from_ground);
  const auto many = ParseSight({{}, "application/json", R"({"rays": "46,7,10,46.1,7,20|1,2,3,1,2,4"})"}, 9);
  ASSERT_TRUE(many) << many.error().message;
  ASSERT_EQ(many->rays.size(), 2u);
  EXPECT_EQ(many->rays[1].to.height_m, 4);
  const std::string body = BytesOf({7, 46, 10, 7.5, 46.5, 20});
  const auto binary = ParseSight({"surface=served", kBinary, body}, 9);
  ASSERT_TRUE(binary) << binary.error().message;
  EXPECT_TRUE(binary->is_binary);
  EXPECT_TRUE(binary->drawn);
  EXPECT_EQ(binary->rays[0].to.longitude, 7.5);
}

// A ray between two high places may be too long although nothing is in between.
TEST(SightQuery, SaysOnlyThatALongRayIsTooLong) {
  const auto query = ParseSight({"from=0,0,1000000&to=0,30,1000000", {}, {}}, 2);
  ASSERT_FALSE(query);
  EXPECT_EQ(query.error().message, "the ray: 3819 km long, the most is 3000 km");
}

// What the message about a wrong body proposes.
template <typename T>
std::string ExampleOf(const Result<T>& parsed) {
  EXPECT_FALSE(parsed);
  const std::string& message = parsed.error().message;
  const std::size_t at = message.find("such as ");
  return at == std::string::npos ? message : message.substr(at + 8);
}

TEST(JsonBodies, AreProposedInTheFormOfTheirEndpoint) {
  constexpr const char* kJson = "application/json";
  for (const char* body : {R"({"rays":[1]})", R"({"from":{"lat":1}})", R"({"v":null})"}) {
    const std::string example = ExampleOf(ParseSight({{}, kJson, body}, 2));
    const auto query = ParseSight({{}, kJson, example}, 2);
    ASSERT_TRUE(query) << example;
    EXPECT_EQ(query->rays.size(), 1U);
  }
  const std::string example = ExampleOf(ParseHeights({{}, kJson, R"({"locations":[[1,2]]})"}, 2));
  const auto query = ParseHeights({{}, kJson, example}, 2);
  ASSERT_TRUE(query) << example;
  EXPECT_EQ(query->points.size(), 2U);
}

TEST(SightQuery, SaysWhatIsWrong) {
  const struct {
    const char* query;
    const char* says;
  } cases[] = {
      {"", "either from and to"},
      {"from=46,7,1", "either from and to"},
      {"from=46,7&to=46,7,1", "from is not"},
      {"from=46,7,1&to=46,7,x", "to is not"},
      {"from=46,7,1&to=46,7,nan", "to is not"},
      {"from=91,7,1&to=46,7,1", "from: the latitude must be"},
      {"from=46,7,1&to=46,181,1", "to: the longitude must be"},
      {"from=46,7,-20000&to=46,7,1", "from: the height must be"},
      {"from=46,7,1&to=-46,-173,1", "km long, the most is 3000 km"},
      {"from=46,7,1&to=46,7,2&rays=1,2,3,4,5,6", "either from and to"},
      {"rays=1,2,3,4,5", "rays: item 1 is not"},
      {"rays=", "rays is empty"},
      {"rays=1,2,3,1,2,3|", "rays: item 2 is not"},
      {"rays=1,2,3,1,2,3|1,2,3,1,2,3|1,2,3,1,2,3", "more than 2"},
      {"from=1,2,3&to=1,2,4&refraction=x", "refraction must be"},
      {"from=1,2,3&to=1,2,4&heights=sea", "heights must be"},
      {"from=1,2,3&to=1,2,4&from=1,2,3", "from is given more than once"},
      {"from=1,2,3&to=1,2,4&level=3", "level needs surface=served"},
      {"frm=1,2,3", "unknown parameter"},
  };
  for (const auto& [query, says] : cases) ExpectSays(ParseSight({query, {}, {}}, 2), says);
  const std::string ray = BytesOf({7, 46, 10, 7.5, 46.5, 20});
  ExpectSays(ParseSight({{}, kBinary, ray.substr(8)}, 2), "40 bytes, which is no multiple of 48");
  ExpectSays(ParseSight({{}, kBinary, ray + ray + ray}, 2), "more than 2 rays");
  ExpectSays(ParseSight({{}, kBinary, ray + BytesOf({7, kNaN, 10, 7.5, 46.5, 20})}, 2),
             "byte 48: ray 2: from: the latitude");
  ExpectSays(ParseSight({{}, kBinary, BytesOf({7, 46, 10, 7.5, 46.5, kInfinity})}, 2), "ray 1: to: the height");
}

}  // namespace
}  // namespace terrace::server
