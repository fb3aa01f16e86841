// Edits: what is wrong with files, and heights at points, nodes and pixels.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "engine/crs/geoid.h"
#include "engine/dem/content_below.h"
#include "engine/dem/elevation_model.h"
#include "engine/dem/tile_edits.h"
#include "engine/geo/error_ladder.h"
#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/dem_fixture.h"
#include "tests/engine/dem/edits_fixture.h"

namespace terrace::dem {
namespace {

TEST_F(TerrainEdits, FlattenInsideBlendOutsideAndNothingBeyond) {
  const auto source = Open(Middle(R"({"op":"flatten","height":500,"blend_m":1000})"));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(At(*source, 10.2, 50.2), 500);
  // Half of the blend: half of the way. A degree is 71,500 m long here.
  const double half = 10.25 + 500 / 71'578.0;
  const double before = 100 + (half - 10.0005) * 1000;
  EXPECT_NEAR(At(*source, half, 50.2), (500 + before) / 2, 1);
  EXPECT_NEAR(At(*source, 10.3, 50.2), 100 + (10.3 - 10.0005) * 1000, 0.01);
}

TEST_F(TerrainEdits, TakeTheMeanOrTheMedian) {
  const auto mean = Open(Middle(R"({"op":"flatten","height":"mean"})"));
  const auto median = Open(Middle(R"({"op":"flatten","height":"median"})"));
  ASSERT_TRUE(mean && median);
  EXPECT_NEAR(At(*mean, 10.2, 50.2), 299.5, 0.01);
  EXPECT_NEAR(At(*median, 10.2, 50.2), 299.5, 4);
}

// A strip, less than a metre wide, from one corner of its box to the opposite one.
TEST_F(TerrainEdits, TakeTheMeanOfANarrowPolygon) {
  const auto strip = Open(
      R"({"type":"Feature","properties":{"terrain":{"op":"flatten","height":"mean"}},"geometry":{"type":"Polygon",)"
      R"("coordinates":[[[10.1,50.1],[10.10001,50.1],[10.30001,50.3],[10.3,50.3],[10.1,50.1]]]}})");
  ASSERT_NE(strip, nullptr);
  EXPECT_NEAR(At(*strip, 10.200005, 50.2), 299.5, 1);
  // Two squares of 20 m, far from each other.
  const auto squares = Open(
      R"({"type":"Feature","properties":{"terrain":{"op":"flatten","height":"mean"}},"geometry":{"type":)"
      R"("MultiPolygon","coordinates":[[[[10.1,50.1],[10.1003,50.1],[10.1003,50.1002],[10.1,50.1002],[10.1,50.1]]],)"
      R"([[[10.3,50.3],[10.3003,50.3],[10.3003,50.3002],[10.3,50.3002],[10.3,50.3]]]]}})");
  ASSERT_NE(squares, nullptr);
  EXPECT_NEAR(At(*squares, 10.10015, 50.1001), 299.5, 1);
}

TEST_F(TerrainEdits, SlopeIsAPlaneOrTriangles) {
  const auto plane = Open(Middle(R"({"op":"slope","heights":[100,200,null,100]})"));
  ASSERT_NE(plane, nullptr);
  EXPECT_NEAR(At(*plane, 10.2, 50.2), 150, 0.01);
  EXPECT_NEAR(At(*plane, 10.24, 50.24), 190, 0.01);
  // Two triangles that share the diagonal of the corners at 0 m.
  const auto bent = Open(Middle(R"({"op":"slope","heights":[0,100,0,300]})"));
  ASSERT_NE(bent, nullptr);
  const double near_east = At(*bent, 10.24, 50.16), near_west = At(*bent, 10.16, 50.24);
  const bool one = std::abs(near_east - 80) < 0.1 && std::abs(near_west - 240) < 0.1;
  const bool other = std::abs(near_east - 92) < 0.1 || std::abs(near_west - 255) < 50;
  EXPECT_TRUE(one || other) << near_east << " " << near_west;
}

TEST_F(TerrainEdits, OffsetAddsAndLaterFeaturesAreOverEarlierOnes) {
  const std::string flat = Middle(R"({"op":"flatten","height":500})"), up = Middle(R"({"op":"offset","metres":-7.5})");
  const auto offset = Open(flat + "," + up), flattened = Open(up + "," + flat);
  ASSERT_TRUE(offset && flattened);
  EXPECT_EQ(At(*offset, 10.2, 50.2), 492.5);
  EXPECT_EQ(At(*flattened, 10.2, 50.2), 500);
}

TEST_F(TerrainEdits, CarveOnlyLowersAndRaiseOnlyRaises) {
  const auto line = [](const char* op) {
    return fmt::format(R"({{"type":"Feature","properties":{{"terrain":{{"op":"{}","width_m":200,"height":250}}}},)"
                       R"("geometry":{{"type":"LineString","coordinates":[[10.05,50.2],[10.35,50.2]]}}}})",
                       op);
  };
  const auto carved = Open(line("carve")), raised = Open(line("raise"));
  ASSERT_TRUE(carved && raised);
  EXPECT_NEAR(At(*carved, 10.1, 50.2), 199.5, 0.01);
  EXPECT_EQ(At(*carved, 10.3, 50.2), 250);
  EXPECT_EQ(At(*raised, 10.1, 50.2), 250);
  EXPECT_NEAR(At(*raised, 10.3, 50.2), 399.5, 0.01);
  EXPECT_NEAR(At(*carved, 10.3, 50.21), 399.5, 0.01);
}

TEST_F(TerrainEdits, HolesHaveNoHeight) {
  const auto source = Open(Middle(R"({"op":"hole"})"));
  ASSERT_NE(source, nullptr);
  EXPECT_TRUE(std::isnan(At(*source, 10.2, 50.2)));
  EXPECT_FALSE(std::isnan(At(*source, 10.3, 50.2)));
  // Tiles have no triangles there, whatever follows.
  const auto filled = Open(Middle(R"({"op":"hole"})") + "," + Middle(R"({"op":"flatten","height":1500})"));
  ASSERT_NE(filled, nullptr);
  EXPECT_TRUE(std::isnan(At(*filled, 10.2, 50.2)));
}

TEST_F(TerrainEdits, AreNeverLeftOutOfALineOfSight) {
  const auto source = Open(Middle(R"({"op":"flatten","height":5000})"));
  ASSERT_NE(source, nullptr);
  const auto look = [&](double from, double to) {
    return source->LookAlong(std::array{SightRay{{from, 50.2, 1000}, {to, 50.2, 1000}}}, {});
  };
  const auto above_edit = look(10.1, 10.3), beside = look(10.3, 10.35);
  ASSERT_FALSE(above_edit.has_value());
  EXPECT_EQ(above_edit.error().code, ErrorCode::kInvalidArgument);
  EXPECT_TRUE(above_edit.error().message.find("surface=served") != std::string::npos) << above_edit.error().message;
  ASSERT_TRUE(beside.has_value());
  EXPECT_TRUE(beside->front().is_visible);
  // Past the north-eastern corner, which lies in the box around the ray.
  EXPECT_TRUE(source->LookAlong(std::array{SightRay{{10.27, 50.24, 1000}, {10.24, 50.27, 1000}}}, {}));
}

TEST_F(TerrainEdits, ReplaceTakesTheHeightsOfAnotherFile) {
  RasterSpec other = FlatSquare(10.1, 50.3, 200, 0.001, 42);
  other.nodata = -1;
  other.value = [](int column, int row) {
    const bool is_wide_void = column >= 55 && column <= 85 && row >= 55 && row <= 85;
    return is_wide_void || (std::abs(column - 120) <= 2 && std::abs(row - 120) <= 2) ? -1.0 : 42.0;
  };
  WriteRaster(dir_, other, "other.tif");
  const auto source = Open(Middle(R"({"op":"replace","source":"other.tif"})"));
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(At(*source, 10.2, 50.2), 42);
  EXPECT_NEAR(At(*source, 10.3, 50.2), 399.5, 0.01);
  EXPECT_NEAR(At(*source, 10.1705, 50.2295), 270, 0.01) << "in the wide void";
  EXPECT_NEAR(At(*source, 10.2205, 50.1795), 320, 0.01) << "in the narrow one";
}

// A raster that is replaced by itself stays as it is.
TEST_F(TerrainEdits, ReplaceHasTheDatumOfTheDatasetOrItsOwn) {
  DemOptions options;
  options.source.vertical = "egm96";
  const auto height = [&](const std::string& terrain) {
    options.edits = terrain.empty() ? std::vector<std::string>() : std::vector{WriteEdits(dir_, Middle(terrain))};
    const auto model = OpenOrFail(slope_, options);
    return model == nullptr ? 0 : At(*model, 10.2, 50.2);
  };
  const double unedited = height("");
  EXPECT_GT(unedited, 340) << "299.5 m above a geoid of more than 40 m";
  EXPECT_EQ(height(R"({"op":"replace","source":"dem.tif"})"), unedited);
  EXPECT_NEAR(height(R"({"op":"replace","source":"dem.tif","vertical":"ellipsoid"})"), 299.5, 0.01);
  options.source.vertical = "unknown";
  EXPECT_EQ(height(R"({"op":"replace","source":"dem.tif","vertical":"egm96"})"), unedited);
  EXPECT_NE(MessageOf(Middle(R"({"op":"replace","source":"dem.tif","vertical":"orthometric"})"))
                .find("vertical is \"orthometric\"; of a source it is"),
            std::string::npos);
}

// Points, nodes and pixels of height images have the same edit.
TEST_F(TerrainEdits, ShowInNodesAndPixels) {
  const auto source = Open(Middle(R"({"op":"flatten","height":777})"));
  ASSERT_NE(source, nullptr);
  const int level = source->max_level();
  const geo::Lattice lattice = source->LatticeOf(level);
  const double step = lattice.StepDegrees();
  const NodeWindow window{static_cast<std::int64_t>((10.2 + 180) / step), static_cast<std::int64_t>((50.2 + 90) / step),
                          3, 3};
  const auto nodes = source->ReadNodes(level, window);
  ASSERT_TRUE(nodes.has_value());
  for (const float height : *nodes) EXPECT_EQ(height, 777);
  const int depth = source->info().max_mercator_depth;
  const double pixels = 256.0 * static_cast<double>(std::int64_t{1} << depth);
  const double y =
      std::log(std::tan(0.25 * 3.14159265358979 + 0.5 * 50.2 * 3.14159265358979 / 180)) / (2 * 3.14159265358979);
  const auto image = source->ReadMercator(depth, {static_cast<std::int64_t>((10.2 + 180) / 360 * pixels),
                                                  static_cast<std::int64_t>((0.5 - y) * pixels), 2, 2});
  ASSERT_TRUE(image.has_value());
  for (const float height : *image) EXPECT_EQ(height, 777);
  EXPECT_EQ(source->info().heights.max, 777);
  EXPECT_NE(source->fingerprint(), source->unedited_fingerprint());
}

TEST_F(TerrainEdits, HeightsLieWithinRangeBounds) {
  const auto source =
      Open(Middle(R"({"op":"offset","metres":600,"blend_m":500})") + "," +
           Rectangle(R"({"op":"slope","heights":[0,-50,-100,5],"blend_m":300})", 10.3, 50.1, 10.35, 50.3));
  ASSERT_NE(source, nullptr);
  for (int level = 6; level <= source->max_level(); ++level) {
    for (const geo::TileRange& range : source->Available(level)) {
      const geo::TileKey key{level, (range.start_x + range.end_x) / 2, (range.start_y + range.end_y) / 2};
      const auto tile = source->Read(key);
      ASSERT_TRUE(tile.has_value());
      const HeightRange bound = source->RangeBound(key);
      for (int j = 0; j <= tile->lattice.cells; ++j) {
        for (int i = 0; i <= tile->lattice.cells; ++i) {
          ASSERT_GE(tile->At(i, j), bound.min);
          ASSERT_LE(tile->At(i, j), bound.max);
        }
      }
    }
  }
}

TEST_F(TerrainEdits, CollectWhatIsWrong) {
  const std::string good = Middle(R"({"op":"offset","metres":1})");
  const auto geometry = [](const char* terrain, const char* geometry) {
    return fmt::format(R"({{"type":"Feature","properties":{{"terrain":{}}},"geometry":{}}})", terrain, geometry);
  };
  const std::string message = MessageOf(
      good + "," + Middle(R"({"op":"flaten","height":1})") + "," + Middle(R"({"op":"flatten"})") + "," +
      Rectangle(R"({"op":"offset","metres":1})", 50.15, 10.15, 50.25, 10.25) + "," +
      geometry(R"({"op":"hole"})",
               R"({"type":"Polygon","coordinates":[[[10.1,50.1],[10.2,50.2],[10.2,50.1],[10.1,50.2],[10.1,50.1]]]})") +
      "," +
      geometry(R"({"op":"hole"})",
               R"({"type":"Polygon","coordinates":[[[10.1,50.1],[10.2,50.2],[10.2,50.1],[10.15,50.3]]]})") +
      "," +
      geometry(R"({"op":"hole"})",
               R"({"type":"Polygon","coordinates":[[[179,50],[-179,50],[-179,51],[179,51],[179,50]]]})") +
      "," +
      geometry(R"({"op":"hole"})",
               R"({"type":"Polygon","coordinates":[[[50.1,100.1],[50.2,100.1],[50.2,100.2],[50.1,100.1]]]})") +
      "," +
      geometry(R"({"op":"carve","width_m":5})", R"({"type":"LineString","coordinates":[[10.1,50.1],[10.2,50.2]]})") +
      "," +
      geometry(R"({"op":"carve","height":5})", R"({"type":"LineString","coordinates":[[10.1,50.1],[10.2,50.2]]})") +
      "," + Rectangle(R"({"op":"offset","metres":1})", 20, 50.15, 21, 50.25) + "," +
      Middle(R"({"op":"offset","meters":1})") + "," + Rectangle(R"({"op":"hole"})", 10, 89.5, 11, 89.95) + "," +
      geometry(R"({"op":"slope"})", R"({"type":"MultiPolygon","coordinates":[)"
                                    R"([[[10.1,50.1,1],[10.2,50.1,2],[10.2,50.2,3],[10.1,50.1,1]]],)"
                                    R"([[[10.3,50.1,7],[10.4,50.1,8],[10.4,50.2,9],[10.3,50.1,7]]]]})"));
  for (const char* part : {"feature 1 at",
                           "did you mean \"flatten\"?",
                           "feature 2 at",
                           "flatten needs a \"height\"",
                           "feature 3 at",
                           "are the axes swapped?",
                           "feature 4 at 50.150000, 10.150000 (lat, lon): the polygon is not valid: Self-intersection",
                           "feature 5 at",
                           "the ring is open",
                           "feature 6 at",
                           "crosses the antimeridian; divide it into two parts of one MultiPolygon",
                           "feature 7 at",
                           "latitude 100.1 is beyond 90",
                           "feature 8 at",
                           "heights are missing",
                           "feature 9 at",
                           "needs its \"width_m\"",
                           "feature 10 at",
                           "outside of the data",
                           "feature 11 at",
                           "did you mean \"metres\"?",
                           "feature 12 at",
                           "reaches a pole",
                           "feature 13 at",
                           "slope takes one polygon; divide the parts into features",
                           "edits.geojson"}) {
    EXPECT_NE(message.find(part), std::string::npos) << part << " in:\n" << message;
  }
  EXPECT_EQ(message.find("feature 0 "), std::string::npos);
}

TEST_F(TerrainEdits, RefuseWhatWouldBeIgnored) {
  const auto parts = [](const std::string& second) {
    return R"({"type":"Feature","properties":{"terrain":{"op":"offset","metres":1}},"geometry":{"type":"MultiPolygon",)"
           R"("coordinates":[[[[10.1,50.1],[10.2,50.1],[10.2,50.2],[10.1,50.2],[10.1,50.1]]],[)" +
           second + "]]}}";
  };
  const std::string message =
      MessageOf(parts("[[10.15,50.15],[10.25,50.15],[10.25,50.25],[10.15,50.25],[10.15,50.15]]") + "," +
                Middle(R"({"op":"slope","heights":["100",200,300,400]})") + ",null," +
                Middle(R"({"op":"precision","error_m":1,"min_level":3.5})") +
                R"(,{"type":"Feature","properties":{"op":"offset","metres":1},"geometry":null})");
  for (const char* part :
       {"feature 0 at 50.150000, 10.150000 (lat, lon): parts of the polygon overlap", "feature 1 at",
        "heights has \"100\"; heights are numbers", "feature 2: is no object of the type", "feature 3 at",
        "min_level is 3.5; it must be a whole number", "feature 4: \"op\" belongs into \"terrain\""}) {
    EXPECT_NE(message.find(part), std::string::npos) << part << " in:\n" << message;
  }
  const std::string of_others = MessageOf(
      Middle(R"({"op":"flatten","height":1,"error_m":0.1})") + "," + Middle(R"({"op":"slope","height":900})") + "," +
      Middle(R"({"op":"hole","blend_m":5})") + "," + Middle(R"({"op":"slope","heights":[1,2,3,4,9999]})"));
  for (const char* part :
       {"flatten has no \"error_m\"; it has op, blend_m, height, vertical", "slope has no \"height\"",
        "hole has no \"blend_m\"", "heights begins with 1 and ends with 9999"}) {
    EXPECT_NE(of_others.find(part), std::string::npos) << part << " in:\n" << of_others;
  }
  // Properties of somebody else.
  EXPECT_NE(Open(Middle(R"({"op":"hole"})") + R"(,{"type":"Feature","properties":{"op":"replace","asset":7},)"
                                              R"("geometry":{"type":"Point","coordinates":[10,50]}})"),
            nullptr);
  // Parts that touch, or lie in a hole of another one.
  EXPECT_NE(Open(parts("[[10.2,50.1],[10.3,50.1],[10.3,50.2],[10.2,50.2],[10.2,50.1]]")), nullptr);
}

// Two parts that meet at 180 degrees are one shape there.
TEST_F(TerrainEdits, MeetAtTheAntimeridian) {
  const std::string slope = WriteSlope(dir_, 179.8, "antimeridian.tif");
  const auto open = [&](const std::string& terrain, const std::string& geometry) {
    DemOptions options;
    options.source.vertical = "ellipsoid";
    options.edits = {WriteEdits(
        dir_, fmt::format(R"({{"type":"Feature","properties":{{"terrain":{}}},"geometry":{}}})", terrain, geometry))};
    return OpenOrFail(slope, options);
  };
  const auto carved =
      open(R"({"op":"carve","width_m":400,"height":50})",
           R"({"type":"MultiLineString","coordinates":[[[179.9,50.1],[180,50.2]],[[-180,50.2],[-179.9,50.3]]]})");
  ASSERT_NE(carved, nullptr);
  EXPECT_EQ(At(*carved, 179.999, 50.2), 50);
  EXPECT_EQ(At(*carved, -179.999, 50.2), 50);
  // Nearest to the part on the other side, whose width reaches across.
  EXPECT_EQ(At(*carved, -179.9995, 50.198), 50);
  EXPECT_EQ(At(*carved, 179.9995, 50.202), 50);
  EXPECT_GT(At(*carved, -179.99, 50.19), 300);
  constexpr int kLevel = 8;
  const auto key = [](double longitude) {
    const double tiles = std::ldexp(1, kLevel) / 180;
    return geo::TileKey{kLevel, static_cast<std::int64_t>((longitude + 180) * tiles),
                        static_cast<std::int64_t>((50.2 + 90) * tiles)};
  };
  EXPECT_NE(TileEdits(*carved).Hash(key(179.99)), 0u);
  EXPECT_NE(TileEdits(*carved).Hash(key(-179.99)), 0u);
  for (const double far : {-170.0, -10.0, 10.0, 170.0}) EXPECT_EQ(TileEdits(*carved).Hash(key(far)), 0u) << far;
  const int finest = carved->max_source_level();
  const auto row = static_cast<std::int64_t>((50.2 + 90) * std::ldexp(1, finest) / 180);
  const auto east = carved->Read({finest, 0, row}), west = carved->Read({finest, geo::TileColumns(finest) - 1, row});
  ASSERT_TRUE(east && west);
  const int cells = east->lattice.cells;
  int low = 0;
  for (int y = 0; y <= cells; ++y) {
    EXPECT_EQ(east->At(0, y), west->At(cells, y));
    low += east->At(0, y) == 50 ? 1 : 0;
  }
  EXPECT_GT(low, 1);
  for (const EditOutline& outline : TileEdits(*carved).Outlines()) {
    ASSERT_EQ(outline.lines.size(), 2u);
    EXPECT_NEAR(outline.lines[0].front().longitude, 179.9, 1e-9);
    EXPECT_NEAR(outline.lines[0].back().longitude, 180, 1e-9);
    EXPECT_NEAR(outline.lines[1].front().longitude, -180, 1e-9);
    EXPECT_NEAR(outline.lines[1].back().longitude, -179.9, 1e-9);
  }

  const std::string parts =
      R"({"type":"MultiPolygon","coordinates":[[[[179.95,50.1],[180,50.1],[180,50.3],[179.95,50.3],[179.95,50.1]]],)"
      R"([[[-180,50.1],[-179.95,50.1],[-179.95,50.3],[-180,50.3],[-180,50.1]]]]})";
  const auto flat = open(R"({"op":"flatten","height":"mean"})", parts);
  const auto lake = open(R"({"op":"flatten","height":20,"vertical":"orthometric"})", parts);
  const auto geoid = Geoid::OfCrs("EPSG:5773", {0, 0});
  ASSERT_TRUE(flat && lake && geoid);
  for (const double longitude : {179.951, 179.99999, 180.0, -180.0, -179.99999, -179.951}) {
    EXPECT_NEAR(At(*flat, longitude, 50.2123), 299.5, 0.01) << longitude;
    EXPECT_NEAR(At(*lake, longitude, 50.2123), 20 + (*geoid)->Undulation({longitude, 50.2123}), 0.01) << longitude;
  }
}

// The shorter way around is that of whole parts: a part on both sides of the Greenwich meridian stays in one piece.
TEST_F(TerrainEdits, KeepPartsWhole) {
  const std::string slope = WriteSlope(dir_, -0.2, "greenwich.tif");
  DemOptions options;
  options.edits = {WriteEdits(dir_,
                              R"({"type":"Feature","properties":{"terrain":{"op":"carve","width_m":200,"height":50}},)"
                              R"("geometry":{"type":"MultiLineString","coordinates":[[[-90,50.2],[60,50.2]],)"
                              R"([[170,50.2],[180,50.2]]]}})")};
  const auto source = OpenOrFail(slope, options);
  ASSERT_NE(source, nullptr);
  EXPECT_EQ(At(*source, -0.05, 50.2), 50);
  EXPECT_EQ(At(*source, 0.05, 50.2), 50);
  EXPECT_GT(At(*source, 0.15, 50.21), 400);
}

TEST_F(TerrainEdits, HaveShortMessagesAboutLongTexts) {
  std::string accents;
  for (int i = 0; i < 100'000; ++i) accents += "\u00e9";
  const std::string message = MessageOf(Middle(R"({"op":"flatten","height":1,"xx)" + accents + "\":1}"));
  EXPECT_LT(message.size(), 1000U);
  EXPECT_EQ(message.substr(message.size() - 6), "\u00e9 ...");  // no half of a character
  EXPECT_LT(MessageOf(Middle(R"({"op":"flatten","height":")" + accents)).size(), 1000U);
}

TEST_F(TerrainEdits, RefuseFilesThatAreNoGeoJson) {
  // Deep values are refused before anything walks them.
  const std::string deep = std::string(100'000, '[') + std::string(100'000, ']');
  for (const std::string& text :
       {std::string("{"), std::string("[]"), std::string(R"({"type":"Feature)"),
        std::string(R"({"type":"FeatureCollection"})"), std::string(), std::string("\xff\xd8 a picture"),
        std::string(R"({"type":"FeatureCollection","features":null})"),
        R"({"type":"FeatureCollection","features":{"a":)" + Middle(R"({"op":"hole"})") + "}}",
        R"({"type":"FeatureCollection","features":[],"crs":)" + deep + "}",
        R"({"type":"FeatureCollection","features":[)" + Middle(R"({"op":"flatten","height":)" + deep + "}") + "]}"}) {
    std::ofstream(dir_.File("bad.geojson")) << text;
    DemOptions options;
    options.edits = {dir_.File("bad.geojson")};
    const auto opened = ElevationModel::Open(slope_, options);
    ASSERT_FALSE(opened.has_value()) << text.substr(0, 200);
    EXPECT_NE(opened.error().message.find("bad.geojson"), std::string::npos);
    EXPECT_TRUE(std::ranges::all_of(opened.error().message, [](char c) { return c > 0; })) << "no UTF-8";
  }
}

// Units of archives know which edits touch them.
TEST_F(TerrainEdits, ChangeTheContentOfTheTilesThatTheyTouch) {
  const auto plain = OpenOrFail(slope_);
  const auto edited = Open(Rectangle(R"({"op":"offset","metres":1})", 10.35, 50.35, 10.36, 50.36));
  ASSERT_TRUE(plain && edited);
  const int level = 10;
  int same = 0, changed = 0;
  for (const geo::TileRange& range : plain->Available(level)) {
    for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
        const bool is_same =
            ContentBelow(*plain, {level, x, y}, level + 2) == ContentBelow(*edited, {level, x, y}, level + 2);
        ++(is_same ? same : changed);
        EXPECT_FALSE(is_same && TileEdits(*edited).Hash({level, x, y}) != 0);
      }
    }
  }
  EXPECT_GT(same, 0);
  EXPECT_GT(changed, 0);
}

// The geoid lies 47 m above the ellipsoid here, by EGM96; PROJ is asked apart from the code under test.
TEST_F(TerrainEdits, CountFromTheGeoidOfTheSources) {
  const auto geoid = Geoid::OfCrs("EPSG:5773", {10, 50});
  ASSERT_TRUE(geoid.has_value()) << geoid.error().message;
  DemOptions options;
  options.source.vertical = "egm96";
  const auto open = [&](const std::string& terrain, const std::string& common = "") {
    const std::string path = dir_.File("datum.geojson");
    std::ofstream(path) << R"({"type":"FeatureCollection",)" << common << R"("features":[)" << Middle(terrain) << "]}";
    options.edits = {path};
    return OpenOrFail(slope_, options);
  };
  const std::string of_all = R"("terrain":{"vertical":"orthometric"},)";
  const auto stated = open(R"({"op":"flatten","height":500,"vertical":"orthometric","blend_m":200})");
  const auto of_file = open(R"({"op":"flatten","height":500,"blend_m":200})", of_all);
  const auto own = open(R"({"op":"flatten","height":500,"vertical":"ellipsoid","blend_m":200})", of_all);
  const auto plane = open(R"({"op":"slope","heights":[100,200,null,100],"vertical":"orthometric"})");
  const auto mean = open(R"({"op":"flatten","height":"mean","vertical":"orthometric"})");
  ASSERT_TRUE(stated && of_file && own && plane && mean);
  EXPECT_EQ(stated->fingerprint(), of_file->fingerprint());
  EXPECT_NE(stated->fingerprint(), own->fingerprint());
  for (const GeoPosition at : {GeoPosition{10.151, 50.151}, GeoPosition{10.2, 50.2}, GeoPosition{10.249, 50.24}}) {
    const double undulation = (*geoid)->Undulation({at.longitude, at.latitude});
    EXPECT_GT(undulation, 40);
    EXPECT_NEAR(At(*stated, at.longitude, at.latitude), 500 + undulation, 0.01);
    EXPECT_EQ(At(*own, at.longitude, at.latitude), 500);
    const double on_plane = 100 + (at.longitude - 10.15) * 1000;
    EXPECT_NEAR(At(*plane, at.longitude, at.latitude), on_plane + undulation, 0.01);
    EXPECT_NEAR(At(*mean, at.longitude, at.latitude), 299.5 + undulation, 0.02);
    const auto above = stated->ReadPoints(std::array{at}, HeightDatum::kOrthometric);
    ASSERT_TRUE(above.has_value());
    EXPECT_NEAR(static_cast<double>(above->front()), 500, 0.01);
  }
  EXPECT_GE(stated->info().heights.max, 500 + 40);
}

TEST_F(TerrainEdits, RefuseDatumsThatTheyDoNotKnow) {
  const std::string message = MessageOf(Middle(R"({"op":"flatten","height":500,"vertical":"orthometrc"})") + "," +
                                        Middle(R"({"op":"offset","metres":5,"vertical":"orthometric"})") + "," +
                                        Middle(R"({"op":"flatten","height":500,"vertical":"orthometric"})") +
                                        R"(],"terrain":{"vertical":"msl","datum":1},"a":[)");
  for (const char* part :
       {"feature 0 at", "did you mean \"orthometric\"?", "feature 1 at", "vertical is of heights, and offset has none",
        "feature 2 at", "vertical datum of the source there is not known", "vertical is \"msl\"",
        "unknown member \"datum\""}) {
    EXPECT_NE(message.find(part), std::string::npos) << part << " in:\n" << message;
  }
}

// A mean is part of the edit's hash after it is known: a source that changes it changes the tiles of all of the
// polygon.
TEST_F(TerrainEdits, HaveAnotherHashIfTheMeanChanges) {
  const auto open = [&](double height_in_the_west) {
    RasterSpec spec;
    spec.width = spec.height = 400;
    spec.geo_transform = {10, 0.001, 0, 50.4, 0, -0.001};
    spec.value = [&](int column, int) { return column < 180 ? height_in_the_west : 100.0 + column; };
    DemOptions options;
    options.edits = {WriteEdits(dir_, Middle(R"({"op":"flatten","height":"mean"})"))};
    return OpenOrFail(WriteRaster(dir_, spec, "half.tif"), options);
  };
  const auto low = open(100);
  ASSERT_NE(low, nullptr);
  const geo::TileKey in_the_east{12, static_cast<std::int64_t>((10.24 + 180) / 180 * 4096),
                                 static_cast<std::int64_t>((50.2 + 90) / 180 * 4096)};
  const std::uint64_t before = TileEdits(*low).Hash(in_the_east);
  const ContentHash content = ContentBelow(*low, in_the_east, 12);
  const auto high = open(130);
  ASSERT_NE(high, nullptr);
  EXPECT_NE(before, 0u);
  EXPECT_NE(TileEdits(*high).Hash(in_the_east), before);
  EXPECT_FALSE(ContentBelow(*high, in_the_east, 12) == content);
  EXPECT_NE(high->fingerprint(), low->fingerprint());
}

}  // namespace
}  // namespace terrace::dem
