// The error of tiles where an edit changes samples between the nodes.
#include <cmath>
#include <cstdint>

#include "engine/edits/edit_window.h"
#include "tests/engine/dem/edits_fixture.h"

namespace terrace::dem {
namespace {

// The distance of a sample of the source from the surface between the nodes of a tile.
double DistanceAt(const TileHeights& tile, const geo::TileKey& key, const GeoPosition& at, double height) {
  const double side = 180.0 / static_cast<double>(geo::TileRows(key.level));
  const double x = ((at.longitude + 180) / side - static_cast<double>(key.x)) * tile.lattice.cells;
  const double y = ((at.latitude + 90) / side - static_cast<double>(key.y)) * tile.lattice.cells;
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const double u = x - i, v = y - j;
  const double south = (1 - u) * tile.At(i, j) + u * tile.At(i + 1, j);
  const double north = (1 - u) * tile.At(i, j + 1) + u * tile.At(i + 1, j + 1);
  return std::abs((1 - v) * south + v * north - height);
}

class EditErrors : public TerrainEdits {
 protected:
  // Expects that the error of the tiles at a position covers the sample there. Returns the largest distance found.
  static double ExpectCovered(const ElevationModel& model, const GeoPosition& at, int first, int last) {
    const double height = At(model, at.longitude, at.latitude);
    double largest = 0;
    for (int level = first; level <= last; ++level) {
      const double side = 180.0 / static_cast<double>(geo::TileRows(level));
      const geo::TileKey key{level, static_cast<std::int64_t>((at.longitude + 180) / side),
                             static_cast<std::int64_t>((at.latitude + 90) / side)};
      const auto tile = model.Read(key);
      EXPECT_TRUE(tile.has_value());
      if (!tile) return 0;
      const double distance = DistanceAt(*tile, key, at, height);
      EXPECT_GE(tile->source_error_m, distance) << level;
      largest = std::max(largest, distance);
    }
    return largest;
  }

  // Expects that the deepest tiles at 10.2, 50.2 are within a centimetre.
  static void ExpectSmall(const ElevationModel& model) {
    for (int level = model.max_level() - 2; level <= model.max_level(); ++level) {
      const double side = 180.0 / static_cast<double>(geo::TileRows(level));
      const auto tile =
          model.Read({level, static_cast<std::int64_t>(190.2 / side), static_cast<std::int64_t>(140.2 / side)});
      ASSERT_TRUE(tile.has_value());
      EXPECT_LT(tile->source_error_m, 0.01) << level;
    }
  }
};

// A void that is open to the north, so that it is not a hole, and narrower than a cell of coarse levels.
TEST_F(EditErrors, CoverVoidsOfAReplacementBetweenNodes) {
  constexpr int kSide = 1500;
  constexpr double kPixel = 1.0 / 6000;
  RasterSpec hill{.width = kSide, .height = kSide, .geo_transform = {10, kPixel, 0, 46, 0, -kPixel}};
  RasterSpec slit = hill;
  hill.value = [](int column, int row) {
    return 3000 * std::exp(-(std::pow(column - 540, 2) + std::pow(row - 540, 2)) / (2 * 225.0 * 225.0));
  };
  slit.nodata = -9999;
  slit.value = [](int column, int row) { return column >= 490 && column < 590 && row < 1000 ? -9999.0 : 0.0; };
  WriteRaster(dir_, slit, "slit.tif");
  DemOptions options;
  options.edits = {
      WriteEdits(dir_, Rectangle(R"({"op":"replace","source":"slit.tif","blend_m":100000})", 9.5, 45.3, 10.7, 46.4))};
  const auto source = OpenOrFail(WriteRaster(dir_, hill, "hill.tif"), options);
  ASSERT_NE(source, nullptr);
  const GeoPosition top{10 + 540.5 * kPixel, 46 - 540.5 * kPixel};
  EXPECT_GT(ExpectCovered(*source, top, 4, source->max_level()), 2900);
}

// A ridge of the replacement, half a sample from its northern end: there are no samples in the cells that it crosses.
TEST_F(EditErrors, CoverHeightsBetweenTheSamplesOfAReplacement) {
  constexpr double kPixel = 1.0 / 3600;
  constexpr int kCoarse = 60;  // times as large
  RasterSpec flat{.width = 200, .height = 200, .geo_transform = {7, kPixel, 0, 46, 0, -kPixel}};
  RasterSpec ridge{.width = 3, .height = 3};
  ridge.geo_transform = {7 + 10.5 * kPixel, kCoarse * kPixel, 0, 46 - 10.5 * kPixel, 0, -kCoarse * kPixel};
  ridge.value = [](int column, int) { return column == 1 ? 1000.0 : 0.0; };
  WriteRaster(dir_, ridge, "ridge.tif");
  DemOptions options;
  options.edits = {WriteEdits(dir_, Rectangle(R"({"op":"replace","source":"ridge.tif"})", 7.005, 45.95, 7.05, 45.995))};
  const auto source = OpenOrFail(WriteRaster(dir_, flat, "flat.tif"), options);
  ASSERT_NE(source, nullptr);
  double largest = 0;
  for (int row = 25; row < 38; ++row) {
    const GeoPosition at{7 + (10.5 + 1.5 * kCoarse) * kPixel, 46 - (row + 0.5) * kPixel};
    largest = std::max(largest, ExpectCovered(*source, at, source->max_level() - 1, source->max_level()));
  }
  EXPECT_GT(largest, 1);
}

// A replacement that no node meets. An earlier edit has changed all of the tile.
TEST_F(EditErrors, CoverAReplacementBetweenNodesInEditedGround) {
  constexpr double kPixel = 1.0 / 3600;
  RasterSpec flat{.width = 2000, .height = 2000, .geo_transform = {7, kPixel, 0, 46, 0, -kPixel}};
  flat.value = [](int, int) { return 100.0; };
  const std::string path = WriteRaster(dir_, flat, "flat.tif");
  const auto unedited = OpenOrFail(path);
  ASSERT_NE(unedited, nullptr);
  int level = unedited->max_level();
  while (unedited->LatticeOf(level).StepDegrees() < 3 * kPixel) --level;
  const double step = unedited->LatticeOf(level).StepDegrees(), fine = step / 10;
  const double west = (std::floor((7.27 + 180) / step) + 0.25) * step - 180, east = west + 5 * fine;
  const double south = (std::floor((45.72 + 90) / step) + 0.25) * step - 90, north = south + 5 * fine;
  RasterSpec survey{.width = 5, .height = 5, .geo_transform = {west, fine, 0, north, 0, -fine}};
  survey.value = flat.value;
  WriteRaster(dir_, survey, "survey.tif");
  DemOptions options;
  options.edits = {
      WriteEdits(dir_, Rectangle(R"({"op":"flatten","height":1000})", 6.5, 45, 8, 46.6) + "," +
                           Rectangle(R"({"op":"replace","source":"survey.tif"})", west, south, east, north))};
  const auto source = OpenOrFail(path, options);
  ASSERT_NE(source, nullptr);
  EXPECT_GT(ExpectCovered(*source, {west + 2.5 * fine, south + 2.5 * fine}, level, level), 800);
}

// The window of the westernmost tiles begins a column west of 180 degrees, so the edit reaches it in two turns. The
// cells between two parts would have no error.
TEST(WindowAxes, HaveOnePartOfAnEditAroundTheEarth) {
  const geo::Lattice lattice{3, 64};
  const NodeWindow window{-1, 3 * 64 - 1, 67, 67};
  const auto parts = WindowAxes(lattice, window).PartsOf({-180, -45, 180, 0});
  ASSERT_EQ(parts.size(), 1u);
  EXPECT_EQ(parts[0].first_column, 0);
  EXPECT_EQ(parts[0].last_column, 66);
}

TEST(WindowAxes, HaveTwoPartsOfAnEditThatIsInTheWindowTwice) {
  const geo::Lattice lattice{0, 64};
  const NodeWindow window{-1, -1, 131, 67};
  const auto parts = WindowAxes(lattice, window).PartsOf({170, 0, 190, 10});
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].first_column, 0);
  EXPECT_EQ(parts[1].last_column, 130);
}

// Inside of a polygon, whether or not its edge is blended.
TEST_F(EditErrors, AreNoLargerWhereAnEditIsConstant) {
  for (const char* const terrain :
       {R"({"op":"flatten","height":777})", R"({"op":"flatten","height":777,"blend_m":5})"}) {
    SCOPED_TRACE(terrain);
    const auto source = Open(Rectangle(terrain, 10.05, 50.05, 10.35, 50.35));
    ASSERT_NE(source, nullptr);
    ExpectSmall(*source);
  }
}

// Also where two parts meet, as those of a polygon that is divided at 180 degrees.
TEST_F(EditErrors, AreNoLargerWherePartsMeet) {
  const std::string parts =
      R"({"type":"MultiPolygon","coordinates":[[[[10.05,50.05],[10.2,50.05],[10.2,50.35],[10.05,50.35],[10.05,50.05]]],)"
      R"([[[10.2,50.05],[10.35,50.05],[10.35,50.35],[10.2,50.35],[10.2,50.05]]]]})";
  const auto source =
      Open(R"({"type":"Feature","properties":{"terrain":{"op":"flatten","height":777}},"geometry":)" + parts + "}");
  ASSERT_NE(source, nullptr);
  for (const double longitude : {10.19999, 10.2, 10.20001}) EXPECT_EQ(At(*source, longitude, 50.2), 777) << longitude;
  EXPECT_NE(At(*source, 10.2, 50.36), 777);
  ExpectSmall(*source);
}

// A strip between two rows of nodes, with one row of samples. It has no blend, so that no node is within its reach.
TEST_F(EditErrors, CoverEditsBetweenNodes) {
  constexpr double kPixel = 0.25 / 111'320;
  constexpr int kSide = 400;
  RasterSpec flat{.width = kSide, .height = kSide, .geo_transform = {10, kPixel, 0, 45, 0, -kPixel}};
  flat.value = [](int, int) { return 100.0; };
  const std::string path = WriteRaster(dir_, flat, "flat.tif");
  for (const int level : {15, 16, 17}) {
    const double step = OpenOrFail(path)->LatticeOf(level).StepDegrees();
    const double row = std::floor((45 - 0.5 * kSide * kPixel + 90) / step);
    const double south = (row + 0.25) * step - 90, north = (row + 0.8) * step - 90;
    const double middle = 45 - (std::floor((45 - 0.5 * (south + north)) / kPixel) + 0.5) * kPixel;
    if (middle < south || middle > north) continue;
    DemOptions options;
    options.edits = {WriteEdits(
        dir_, Rectangle(R"({"op":"offset","metres":30})", 10 + 150 * kPixel, south, 10 + 250 * kPixel, north))};
    const auto source = OpenOrFail(path, options);
    ASSERT_NE(source, nullptr);
    EXPECT_GT(ExpectCovered(*source, {10 + 200.5 * kPixel, middle}, level, level), 29) << level;
  }
}

}  // namespace
}  // namespace terrace::dem
