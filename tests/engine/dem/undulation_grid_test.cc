// Compares grids of undulations with the results of PROJ.
#include "engine/crs/undulation_grid.h"

#include <cpl_string.h>
#include <gdal_priv.h>

#include <cmath>
#include <random>

#include "engine/crs/undulations.h"
#include "engine/gdal/gdal_runtime.h"
#include "tests/engine/dem/geoid_grids.h"

namespace terrace::dem {
namespace {

float Wavy(int column, int row) {
  return static_cast<float>(30 + 10 * std::sin(column * 0.7) * std::cos(row * 0.9) + 0.1 * column);
}

struct TiffSpec {
  std::array<double, 6> geo_transform = {6.95, 0.1, 0, 47.05, 0, -0.1};
  int columns = 31, rows = 21;
  std::vector<std::string> bands = {"geoid_undulation"};
  double scale = 1, offset = 0;
  std::optional<double> no_data = {};
  bool is_second = false;  // appended to the file
  std::function<float(int column, int row)> value = Wavy;
};

// In PROJ's format: https://proj.org/en/9.1/specifications/geodetictiffgrids.html
std::string WriteTiff(const TempDir& dir, const std::string& name, const TiffSpec& spec) {
  InitGdal();
  const std::string path = dir.File(name);
  const char* const options[] = {spec.is_second ? "APPEND_SUBDATASET=YES" : nullptr, nullptr};
  const GDALDatasetUniquePtr dataset(GetGDALDriverManager()->GetDriverByName("GTiff")->Create(
      path.c_str(), spec.columns, spec.rows, static_cast<int>(spec.bands.size()), GDT_Float32,
      const_cast<char**>(options)));
  auto transform = spec.geo_transform;
  dataset->SetGeoTransform(transform.data());
  OGRSpatialReference srs;
  srs.SetWellKnownGeogCS("WGS84");
  dataset->SetSpatialRef(&srs);
  dataset->SetMetadataItem("TYPE", "VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL");
  for (std::size_t b = 0; b < spec.bands.size(); ++b) {
    GDALRasterBand& band = *dataset->GetRasterBand(static_cast<int>(b) + 1);
    band.SetDescription(spec.bands[b].c_str());
    const bool counts = spec.bands[b] == "geoid_undulation";
    if (counts && (spec.scale != 1 || spec.offset != 0)) {
      band.SetScale(spec.scale);
      band.SetOffset(spec.offset);
    }
    if (spec.no_data) band.SetNoDataValue(*spec.no_data);
    for (int row = 0; row < spec.rows; ++row) {
      std::vector<float> line;
      for (int column = 0; column < spec.columns; ++column) line.push_back(counts ? spec.value(column, row) : -7.0f);
      EXPECT_EQ(
          band.RasterIO(GF_Write, 0, row, spec.columns, 1, line.data(), spec.columns, 1, GDT_Float32, 0, 0, nullptr),
          CE_None);
    }
  }
  return path;
}

std::shared_ptr<const Geoid> GeoidOf(const std::string& path, Position centre) {
  auto geoid = Geoid::OfGrid(path, centre);
  EXPECT_TRUE(geoid) << geoid.error().message;
  return geoid ? *std::move(geoid) : nullptr;
}

// Nodes of lattices of several levels around `box` have PROJ's undulations, and are within the bounds over a box around
// each.
void ExpectProjs(const Geoid& geoid, const std::shared_ptr<const Geoid>& shared, const Footprint& box, double close) {
  const auto undulations = Undulations::Of(shared, box);
  ASSERT_TRUE(undulations) << undulations.error().message;
  const Geoid::Reader exact(geoid);
  int known = 0;
  for (const int level : {3, 6, 9}) {
    const geo::Lattice lattice{level, 64};
    const double step = lattice.StepDegrees();
    const NodeWindow window{static_cast<std::int64_t>((box.west + 180) / step) - 1,
                            static_cast<std::int64_t>((box.south + 90) / step) - 1,
                            std::min(static_cast<int>((box.east - box.west) / step) + 3, 400),
                            std::min(static_cast<int>((box.north - box.south) / step) + 3, 400)};
    const auto values = (*undulations)->At(lattice, window);
    ASSERT_TRUE(values) << values.error().message;
    for (int i = 0; i < window.columns * window.rows; ++i) {
      const double value = (*values)[static_cast<std::size_t>(i)];
      const Position at{lattice.Longitude(window.column + i % window.columns),
                        lattice.Latitude(window.row + i / window.columns)};
      const double turned = at.x < box.west ? at.x + 360 : at.x;
      if (turned < box.west || turned > box.east || at.y < box.south || at.y > box.north) {
        ASSERT_TRUE(std::isnan(value)) << at.x << " " << at.y;
        continue;
      }
      const bool is_pole = std::abs(at.y) == 90;  // a pole has one undulation
      const double there = exact.At({is_pole ? 0 : at.x, at.y});
      ASSERT_EQ(std::isnan(value), std::isnan(there)) << "level " << level << " " << at.x << " " << at.y;
      if (std::isnan(value)) continue;
      ++known;
      ASSERT_NEAR(value, there, close) << "level " << level << " " << at.x << " " << at.y;
      const HeightRange range = (*undulations)->RangeOf(at.x - step / 2, at.y - step / 2, step, step);
      ASSERT_GE(value, range.min) << at.x << " " << at.y;
      ASSERT_LE(value, range.max) << at.x << " " << at.y;
    }
  }
  EXPECT_GT(known, 100);
}

constexpr double kClose = 1e-6;

TEST(UndulationGrid, OfGtxIsProjs) {
  const TempDir dir;
  const auto geoid = GeoidOf(WriteGtx(dir, "grid.gtx", {.value = Wavy}), {8, 46});
  ASSERT_NE(geoid->grid(), nullptr);
  EXPECT_DOUBLE_EQ(geoid->finest_cell(), 0.1);
  ExpectProjs(*geoid, geoid, {6.5, 44.5, 10.5, 47.5}, kClose);
}

TEST(UndulationGrid, AroundTheEarthIsProjs) {
  const TempDir dir;
  // From 0 to 359 degrees, as EGM2008's.
  const auto geoid = GeoidOf(
      WriteGtx(dir, "earth.gtx", {.west = 0, .south = -90, .step = 1, .columns = 360, .rows = 181, .value = Wavy}),
      {8, 46});
  ASSERT_NE(geoid->grid(), nullptr);
  EXPECT_TRUE(geoid->grid()->wraps());
  ExpectProjs(*geoid, geoid, {-180, -90, 180, 90}, kClose);
  ExpectProjs(*geoid, geoid, {-3, 40, 5, 50}, kClose);
  ExpectProjs(*geoid, geoid, {170, -10, 190, 10}, kClose);
}

TEST(UndulationGrid, AcrossTheAntimeridianIsProjs) {
  const TempDir dir;
  const auto geoid =
      GeoidOf(WriteGtx(dir, "fiji.gtx", {.west = 177, .south = -20, .step = 0.2, .value = Wavy}), {179, -18});
  ASSERT_NE(geoid->grid(), nullptr);
  ExpectProjs(*geoid, geoid, {176, -21, 184, -15}, kClose);
}

TEST(UndulationGrid, WithHolesIsProjs) {
  const TempDir dir;
  const auto holed = [](int column, int row) { return (column + 2 * row) % 7 == 0 ? -88.8888f : Wavy(column, row); };
  const auto geoid = GeoidOf(WriteGtx(dir, "holes.gtx", {.value = holed}), {8.03, 46.04});
  ASSERT_NE(geoid->grid(), nullptr);
  ExpectProjs(*geoid, geoid, {6.5, 44.5, 10.5, 47.5}, kClose);
}

TEST(UndulationGrid, OfGeoTiffIsProjs) {
  const TempDir dir;
  int number = 0;
  for (const TiffSpec& spec : {TiffSpec{}, TiffSpec{.scale = 0.01, .offset = 25}, TiffSpec{.no_data = -1},
                               TiffSpec{.bands = {"geoid_undulation_accuracy", "geoid_undulation"}},
                               TiffSpec{.geo_transform = {-180.5, 1, 0, 90.5, 0, -1}, .columns = 360, .rows = 181}}) {
    SCOPED_TRACE(number);
    const auto geoid = GeoidOf(WriteTiff(dir, std::to_string(number++) + ".tif", spec), {8, 46});
    ASSERT_NE(geoid, nullptr);
    EXPECT_NE(geoid->grid(), nullptr);
    ExpectProjs(*geoid, geoid, {6.5, 44.5, 10.5, 47.5}, kClose);
  }
}

// A coarse grid and a fine one inside it, with a summit at one node: PROJ uses the finer one where it exists.
TEST(UndulationGrid, OfSeveralGridsIsLeftToProj) {
  const TempDir dir;
  WriteTiff(dir, "nested.tif", {});
  const std::string path = WriteTiff(
      dir, "nested.tif",
      {.geo_transform = {7.995, 0.01, 0, 46.205, 0, -0.01}, .is_second = true, .value = [](int column, int row) {
         return column == 17 && row == 11 ? 60.0f : Wavy(column, row);
       }});
  const auto geoid = GeoidOf(path, {8.1, 46.1});
  ASSERT_NE(geoid, nullptr);
  EXPECT_EQ(geoid->grid(), nullptr);
  ExpectProjs(*geoid, geoid, {7.5, 45.5, 9, 46.9}, Undulations::kTolerance);
}

}  // namespace
}  // namespace terrace::dem
