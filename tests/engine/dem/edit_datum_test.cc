// Edits in the vertical datum of the sources: heights that an edit states in it are not converted.
#include <algorithm>
#include <cmath>
#include <vector>

#include "engine/crs/geoid.h"
#include "engine/geo/mercator_grid.h"
#include "tests/engine/dem/edits_fixture.h"

namespace terrace::dem {
namespace {

constexpr GeoPosition kMiddle{10.2, 50.2};

// A source of uneven heights above EGM96, which is 47 m above the ellipsoid here.
class EditDatums : public TerrainEdits {
 protected:
  EditDatums() {
    options_.source.vertical = "egm96";
    hills_.width = hills_.height = 400;
    hills_.geo_transform = {10, 0.001, 0, 50.4, 0, -0.001};
    hills_.value = [](int column, int row) { return 20 + 13.7 * std::sin(column * 0.31) * std::cos(row * 0.17); };
    WriteRaster(dir_, hills_, "hills.tif");
    RasterSpec flat = hills_;
    flat.value = [](int, int) { return 12.3; };
    WriteRaster(dir_, flat, "flat.tif");
  }
  std::unique_ptr<ElevationModel> OpenHills(const std::string& features) {
    options_.edits = {WriteEdits(dir_, features)};
    return OpenOrFail(dir_.File("hills.tif"), options_);
  }

  DemOptions options_;
  RasterSpec hills_;
};

// A height in the datum of the sources, and where it is.
struct DatumHeight {
  GeoPosition at;
  float height;
};

std::vector<DatumHeight> OfTile(const ElevationModel& model, int level, const GeoPosition& at) {
  const double side = 180.0 / static_cast<double>(geo::TileRows(level));
  const geo::TileKey key{level, static_cast<std::int64_t>((at.longitude + 180) / side),
                         static_cast<std::int64_t>((at.latitude + 90) / side)};
  const auto tile = model.ReadInSourceDatum(key);
  EXPECT_TRUE(tile);
  std::vector<DatumHeight> found;
  for (int j = 0; tile && j <= tile->lattice.cells; ++j) {
    for (int i = 0; i <= tile->lattice.cells; ++i) {
      found.push_back({{tile->lattice.Longitude(tile->lattice.FirstColumn(key) + i),
                        tile->lattice.Latitude(tile->lattice.FirstRow(key) + j)},
                       tile->At(i, j)});
    }
  }
  return found;
}

std::vector<DatumHeight> OfMap(const ElevationModel& model, int depth, const GeoPosition& at) {
  const geo::MercatorGrid grid{depth};
  NodeWindow window{static_cast<std::int64_t>((at.longitude + 180) / grid.StepDegrees()) - 100, 0, 200, 200};
  while (grid.Latitude(window.row + 100) > at.latitude) window.row += 50;
  const auto heights = model.ReadKnownMercator(depth, window, HeightDatum::kSource);
  EXPECT_TRUE(heights);
  std::vector<DatumHeight> found;
  for (std::int64_t i = 0; heights && i < 200 * 200; ++i) {
    found.push_back({{grid.Longitude(window.column + i % 200), grid.Latitude(window.row + i / 200)},
                     (*heights)[static_cast<std::size_t>(i)]});
  }
  return found;
}

std::vector<DatumHeight> OfPoints(const ElevationModel& model, const GeoPosition& at) {
  std::vector<GeoPosition> points;
  for (int i = 0; i < 41 * 41; ++i)
    points.push_back({at.longitude + (i % 41 - 20) * 0.0043, at.latitude + (i / 41 - 20) * 0.0037});
  const auto heights = model.ReadPoints(points, HeightDatum::kOrthometric);
  EXPECT_TRUE(heights);
  std::vector<DatumHeight> found;
  for (std::size_t i = 0; heights && i < points.size(); ++i) found.push_back({points[i], (*heights)[i]});
  return found;
}

std::vector<std::vector<DatumHeight>> AllPaths(const ElevationModel& model, const GeoPosition& at) {
  return {OfTile(model, 11, at), OfTile(model, 12, at), OfMap(model, 8, at), OfMap(model, 9, at), OfPoints(model, at)};
}

// Degrees inside the rectangle of Middle; negative outside.
double Inside(const GeoPosition& at) {
  return std::min({at.longitude - 10.15, 10.25 - at.longitude, at.latitude - 50.15, 50.25 - at.latitude});
}

TEST_F(EditDatums, KeepStatedHeights) {
  const struct {
    const char* terrain;
    double height;
  } kCases[] = {{R"({"op":"flatten","height":0,"vertical":"orthometric"})", 0},
                {R"({"op":"flatten","height":0,"vertical":"orthometric","blend_m":900})", 0},
                {R"({"op":"flatten","height":-431.4567,"vertical":"orthometric"})", -431.4567},
                {R"({"op":"slope","heights":[7.77,7.77,7.77,7.77],"vertical":"orthometric"})", 7.77},
                {R"({"op":"replace","source":"flat.tif","blend_m":900})", 12.3},
                {R"({"op":"replace","source":"flat.tif","vertical":"EPSG:5773"})", 12.3}};
  for (const auto& [terrain, height] : kCases) {
    SCOPED_TRACE(terrain);
    const auto source = OpenHills(Middle(terrain));
    ASSERT_NE(source, nullptr);
    for (const auto& path : AllPaths(*source, kMiddle)) {
      int inside = 0, wrong = 0;
      for (const auto& [at, found] : path) {
        if (Inside(at) < 1e-6) continue;
        ++inside;
        // Of the nearest multiples of 2^-10 m.
        wrong += static_cast<double>(found) == std::nearbyint(static_cast<float>(height) * 1024.0) / 1024 ? 0 : 1;
      }
      EXPECT_GT(inside, 400);
      EXPECT_EQ(wrong, 0) << "of " << inside;
    }
  }
}

// Later edits begin with the exact height, and a hole has none.
TEST_F(EditDatums, KeepStatedHeightsUnderOthers) {
  const auto source = OpenHills(Middle(R"({"op":"flatten","height":0,"vertical":"orthometric"})") + "," +
                                Middle(R"({"op":"offset","metres":2.5})") + "," +
                                Rectangle(R"({"op":"hole"})", 10.15, 50.15, 10.2, 50.2));
  ASSERT_NE(source, nullptr);
  for (const auto& path : AllPaths(*source, kMiddle)) {
    for (const auto& [at, found] : path) {
      if (Inside(at) < 1e-6 || std::isnan(found)) continue;
      ASSERT_EQ(found, 2.5f) << at.longitude << " " << at.latitude;
    }
  }
}

// Expects that a tile's heights differ by the undulation in both datums.
void ExpectOneSurface(const ElevationModel& model, const GeoPosition& at, double undulation_of(const GeoPosition&)) {
  constexpr int kLevel = 12;
  const double side = 180.0 / static_cast<double>(geo::TileRows(kLevel));
  const auto above = model.Read({kLevel, static_cast<std::int64_t>((at.longitude + 180) / side),
                                 static_cast<std::int64_t>((at.latitude + 90) / side)});
  ASSERT_TRUE(above);
  const std::vector<DatumHeight> nodes = OfTile(model, kLevel, at);
  const int columns = above->lattice.cells + 1;
  for (int k = 0; k < columns * columns; ++k) {
    const auto& [position, height] = nodes[static_cast<std::size_t>(k)];
    ASSERT_NEAR(static_cast<double>(height) + undulation_of(position),
                static_cast<double>(above->At(k % columns, k / columns)), 0.005)
        << position.longitude << " " << position.latitude;
  }
}

double Egm96(const GeoPosition& at) {
  static const auto geoid = Geoid::OfCrs("EPSG:5773", {10, 50});
  return geoid ? (*geoid)->Undulation({at.longitude, at.latitude}) : 0;
}

// In the blend, at its end, and for edits that are stated in another datum.
TEST_F(EditDatums, AreOneSurfaceInBothDatums) {
  ASSERT_GT(Egm96(kMiddle), 40);
  for (const char* const terrain :
       {R"({"op":"flatten","height":300,"vertical":"orthometric","blend_m":3000})",
        R"({"op":"flatten","height":300,"blend_m":3000})", R"({"op":"replace","source":"flat.tif","blend_m":3000})",
        R"({"op":"replace","source":"flat.tif","vertical":"ellipsoid","blend_m":3000})",
        R"({"op":"offset","metres":-70,"blend_m":3000})"}) {
    SCOPED_TRACE(terrain);
    const auto source = OpenHills(Middle(terrain));
    ASSERT_NE(source, nullptr);
    for (const GeoPosition at : {GeoPosition{10.14, 50.2}, GeoPosition{10.1, 50.2}, kMiddle}) {
      ExpectOneSurface(*source, at, Egm96);
    }
  }
}

// A lake over two sources of which only one counts from its geoid.
TEST_F(EditDatums, AreConvertedBesideSourcesOfOtherDatums) {
  RasterSpec west = hills_;
  west.width = 200;
  RasterSpec east = west;
  east.geo_transform[0] = 10.2;
  const auto lake = R"({"op":"flatten","height":300,"vertical":"orthometric"})";
  DemOptions options;
  options.edits = {WriteEdits(dir_, Middle(lake))};
  for (const char* const of_east : {"ellipsoid", "egm96"}) {
    const bool is_one = std::string(of_east) == "egm96";
    const auto source = OpenOrFail({{.path = WriteRaster(dir_, west, "west.tif"), .options = SourceOptions{"egm96"}},
                                    {.path = WriteRaster(dir_, east, "east.tif"), .options = SourceOptions{of_east}}},
                                   options);
    ASSERT_NE(source, nullptr);
    for (const auto& [at, height] : OfTile(*source, 11, {10.17, 50.2})) {
      if (Inside(at) < 1e-6 || std::abs(at.longitude - 10.2) < 0.002) continue;
      const bool is_ellipsoidal = at.longitude > 10.2 && !is_one;
      ASSERT_NEAR(static_cast<double>(height), 300 + (is_ellipsoidal ? Egm96(at) : 0), is_one ? 0 : 0.005)
          << of_east << " " << at.longitude << " " << at.latitude;
    }
  }
}

}  // namespace
}  // namespace terrace::dem
