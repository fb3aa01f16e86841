#include "fly/scene/flight_path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace terrace::fly {
namespace {

constexpr FlightSpeed kSpeed{200, -20};

TEST(FlightPath, KeepsItsSpeed) {
  const FlightPath path = MakeStraightPath({7, 46, 3000}, {8, 46.5, 5000}, kSpeed);
  const double whole = path.duration_s();
  EXPECT_NEAR(path.length_m(), whole * 200, 1);
  for (double t = 0; t + 1 < whole; t += whole / 17) {
    const GeodeticPoint a = path.PoseAt(t).position, b = path.PoseAt(t + 1).position;
    const double metres = geo::Length(geo::ToEcef(a.longitude, a.latitude, a.height_m) -
                                      geo::ToEcef(b.longitude, b.latitude, b.height_m));
    EXPECT_NEAR(metres, 200, 2);
  }
  EXPECT_NEAR(path.PoseAt(whole).position.height_m, 5000, 1e-6);
  EXPECT_NEAR(path.PoseAt(2 * whole - 1).position.latitude, path.PoseAt(1).position.latitude, 1e-9);  // back and forth
}

TEST(FlightPath, CrossesTheAntimeridianOnTheShortWay) {
  const FlightPath path = MakeStraightPath({179.5, 20, 3000}, {-179.5, 20, 3000}, kSpeed);
  EXPECT_LT(path.length_m(), 110'000);
  const double middle = std::abs(path.PoseAt(path.duration_s() / 2).position.longitude);
  EXPECT_NEAR(middle, 180, 0.01);
}

TEST(FlightPath, BetweenOppositePlacesIsNotTheShortest) {
  EXPECT_TRUE(AreOpposite({0, 0, 5e6}, {180, 0, 5e6}));
  EXPECT_TRUE(AreOpposite({10, 20, 0}, {-170, -20, 0}));
  EXPECT_FALSE(AreOpposite({0, 0, 5e6}, {179, 0, 5e6}));
  EXPECT_FALSE(AreOpposite({7, 46, 3000}, {7, 46, 3000}));
}

TEST(FlightPath, CirclesAtItsRadius) {
  const FlightPath path = MakeCircle({-156.3, 20.8, 4000}, 20'000, kSpeed);
  EXPECT_NEAR(path.length_m(), 2 * 3.14159265 * 20'000, 50);
  EXPECT_NEAR(path.PoseAt(0).position.latitude, path.PoseAt(path.duration_s()).position.latitude, 1e-6);
  EXPECT_NEAR(path.PoseAt(0.01).heading, 90, 1.5);
}

TEST(FlightPath, CirclesAroundAPoleAndThroughIt) {
  constexpr double kRadius = 100'000, kMeanRadius = 6371000;
  for (const double latitude : {90.0, -90.0, 89.999999, 89.5, -89.1}) {
    const FlightPath path = MakeCircle({25, latitude, 4000}, kRadius, kSpeed);
    EXPECT_NEAR(path.length_m(), 2 * 3.14159265 * kRadius, 250) << latitude;
    const geo::Vec3 center = geo::SurfaceNormal(25, latitude);
    for (const FlightPath::Point& point : path.points) {
      const GeodeticPoint& p = point.pose.position;
      const geo::Vec3 normal = geo::SurfaceNormal(p.longitude, p.latitude);
      EXPECT_NEAR(kMeanRadius * std::atan2(geo::Length(geo::Cross(center, normal)), geo::Dot(center, normal)), kRadius,
                  0.01);
    }
  }
}

TEST(FlightPath, RestsAtOnePlace) {
  const FlightPath path = MakeStraightPath({7, 46, 3000}, {7, 46, 3000}, kSpeed);
  EXPECT_EQ(path.duration_s(), 0);
  EXPECT_EQ(path.PoseAt(12).position.height_m, 3000);
}

TEST(FlightPath, ReadsLinesAndGeoJson) {
  const Result<FlightPath> timed = ParsePath("# t\n5, 7,46,3000, 10,-30\n 7, 7.1,46,3000, 350,-30\n", kSpeed);
  ASSERT_TRUE(timed) << timed.error().message;
  EXPECT_EQ(timed->duration_s(), 2);
  EXPECT_NEAR(timed->PoseAt(1).heading, 0, 1e-9);  // the short turn
  EXPECT_NEAR(timed->PoseAt(1).position.longitude, 7.05, 1e-9);
  const Result<FlightPath> line = ParsePath("7 46 3000\n8 46 3000", kSpeed);
  ASSERT_TRUE(line);
  EXPECT_NEAR(line->PoseAt(0).heading, 90, 1);
  EXPECT_EQ(line->PoseAt(0).pitch, -20);
  const Result<FlightPath> json = ParsePath(
      R"({"type":"Feature","geometry":{"type":"LineString","coordinates":[[7,46,3000],[8,46,3000]]}})", kSpeed);
  ASSERT_TRUE(json) << json.error().message;
  EXPECT_DOUBLE_EQ(json->length_m(), line->length_m());
}

TEST(FlightPath, FindsTheLineStringOfAGeometry) {
  const std::string line = R"({"type":"LineString","coordinates":[[7,46,3000],[8,46,3000]]})";
  const std::string other = R"({"type":"LineString","coordinates":[[1,1,1]]})";
  for (const std::string& text :
       {R"({"type":"Feature","properties":{"type":7,"way":)" + other + R"(},"geometry":)" + line + "}",
        R"({"type":"FeatureCollection","crs":{"type":null},"features":[{"type":"Feature","geometry":null},)"
        R"({"type":"Feature","geometry":)" +
            line + "}]}",
        R"({"type":"GeometryCollection","geometries":[{"type":"Point","coordinates":[1,2,3]},)" + line + "]}"}) {
    const Result<FlightPath> path = ParsePath(text, kSpeed);
    ASSERT_TRUE(path) << text << path.error().message;
    EXPECT_EQ(path->points.size(), 2U) << text;
  }
}

TEST(FlightPath, LooksAlongThePathWherePointsAreRepeated) {
  for (const char* text :
       {"8,46,3000\n8.1,46,3000\n8.1,46,3000\n8.2,46,3000\n8.2,46,3000",
        "8,46,3000\n8.1,46,3000\n8.1,46,4000\n8.2,46,4000\n8.2,46,3000",  // vertical parts
        "1.1,0,3000\n7.3,0,3000\n7.3,0,3000\n7.4,0,3000",                 // rounding moves the repeated point
        R"({"type":"LineString","coordinates":[[8,46,3000],[8.1,46,3000],[8.1,46,3000],[8.2,46,3000]]})"}) {
    const Result<FlightPath> path = ParsePath(text, kSpeed);
    ASSERT_TRUE(path) << path.error().message;
    const double whole = path->duration_s();
    for (double t = 0; t <= whole; t += whole / 997) EXPECT_NEAR(path->PoseAt(t).heading, 90, 0.1) << text << t;
  }
  // Stated headings stay: of the first of equal points.
  const Result<FlightPath> stated = ParsePath("8,46,1,10,0\n8,46,1,20,0\n8.1,46,1,30,0", kSpeed);
  ASSERT_TRUE(stated);
  ASSERT_EQ(stated->points.size(), 2U);
  EXPECT_EQ(stated->PoseAt(0).heading, 10);
  EXPECT_EQ(stated->PoseAt(stated->duration_s()).heading, 30);
}

TEST(FlightPath, SkipsAByteOrderMark) {
  for (const char* text :
       {"7 46 3000\n8 46 3000", R"({"type":"LineString","coordinates":[[7,46,3000],[8,46,3000]]})"}) {
    const Result<FlightPath> path = ParsePath(std::string("\xEF\xBB\xBF") + text, kSpeed);
    ASSERT_TRUE(path) << path.error().message;
    EXPECT_EQ(path->points.size(), 2U);
  }
}

TEST(FlightPath, HasHeightsFromBelowTheOceansToAboveTheSatellites) {
  for (const char* height : {"-12000", "0", "1e7", "1e8"})
    EXPECT_TRUE(ParsePath(std::string("7,46,") + height, kSpeed));
  for (const std::string height : {"-6400000", "-12001", "100000001", "1e300"}) {
    for (const std::string& text : {"7,46,1\n7,46," + height, "0,7,46,1,0,0\n1,7,46," + height + ",0,0",
                                    R"({"type":"LineString","coordinates":[[7,46,1],[7,46,)" + height + "]]}"}) {
      const Result<FlightPath> path = ParsePath(text, kSpeed);
      ASSERT_FALSE(path) << text;
      EXPECT_NE(path.error().message.find(" 2: the height must be a number from -12000 to 100000000 m"),
                std::string::npos)
          << path.error().message;
    }
  }
  EXPECT_FALSE(CheckPosition({7, 46, std::nan("")}));
  EXPECT_FALSE(CheckPosition({std::nan(""), 46, 0}));
}

TEST(FlightPath, NamesTheLineThatIsWrong) {
  const auto message = [](std::string_view text) { return ParsePath(text, kSpeed).error().message; };
  EXPECT_NE(message("7,46,3000\n7,x,3000").find("line 2"), std::string::npos);
  EXPECT_NE(message("46.5,97,3000").find("in this order"), std::string::npos);
  EXPECT_NE(message("7,46").find("2 numbers"), std::string::npos);
  EXPECT_NE(message("1,7,46,1,0,0\n1,8,46,1,0,0").find("ascend"), std::string::npos);
  EXPECT_NE(message("nan,46,1").find("line 1"), std::string::npos);
  EXPECT_NE(message("7,46,1,1e9,0").find("line 1: heading"), std::string::npos);
  EXPECT_NE(message("7,46,1,0,-91").find("line 1: heading"), std::string::npos);
  for (const char* text :
       {"-84.2,36.3,1\n-84.2,36.3-0.1", "7,46,1\n,,", "7,46,1\n7,,46,1", "7,46,1\n7,46,1,", "7,46,1\n,7,46,1"}) {
    EXPECT_NE(message(text).find("line 2: has something other than numbers with commas or blanks between them; write "
                                 "lon,lat,height"),
              std::string::npos)
        << message(text);
  }
  EXPECT_EQ(message(R"({"type":"LineString"})"), "the GeoJSON cannot be read: key 'coordinates' not found");
  EXPECT_NE(message("").find("no points"), std::string::npos);
  EXPECT_NE(message(R"({"type":"Point"})").find("no LineString"), std::string::npos);
  EXPECT_NE(message(R"({"type":"LineString","coordinates":[]})").find("no points"), std::string::npos);
  EXPECT_NE(message(R"({"type":"LineString","coordinates":[[7,46,1],[7,46]]})").find("point 2"), std::string::npos);
}

}  // namespace
}  // namespace terrace::fly
