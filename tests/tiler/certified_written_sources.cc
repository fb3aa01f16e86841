#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <utility>

#include "tests/tiler/certified_sources.h"

namespace terrace::tiler {
namespace {

using Source = std::optional<CertifiedSource>;

// More raster grids than the limit for querying whole windows, each on a different grid.
Source ManySmallGrids(const dem::TempDir& dir, std::string&) {
  CertifiedSource source;
  for (int k = 0; k < 16; ++k) {
    dem::RasterSpec spec;
    spec.width = 60;
    spec.height = 50;
    const double step = 0.01 + 0.0001 * k;
    spec.geo_transform = {10.0 + 0.8 * (k % 4), step, 0, 40.0 + 0.8 * (k / 4), 0, -step};
    spec.value = [k](int x, int y) {
      return 900 + 300 * std::sin(0.2 * x + k) * std::cos(0.13 * y) + (x * 7 + y * 11) % 17;
    };
    source.files.push_back({dem::WriteRaster(dir, spec, "s" + std::to_string(k) + ".tif")});
    for (const Sample& sample : SamplesOf(source.files.back().path)) source.samples.push_back(sample);
  }
  return source;
}

// Samples of all rasters are at nodes of level 12, those of the base at every 16th, so blended heights can be read
// sample by sample.
constexpr int kLevel = 12, kPieces = 512, kBase = 16, kRim = 512;  // nodes
constexpr double kStep = 180.0 / 4096 / 256;
constexpr std::int64_t kFirstColumn = 1088 * 256, kFirstRow = 2800 * 256;

double Ground(double column, double row) {
  return 900 + 500 * std::sin(column * .013) * std::cos(row * .011) + 30 * std::sin(column * .31 + row * .17);
}
bool IsHole(int column, int row) { return std::hypot(column - 300, row - 420) < 90; }

// Its first sample is `column` east and `row` south of the first sample of the pieces.
std::string WriteAtNodes(const dem::TempDir& dir, const std::string& name, int column, int row, int size, int spacing,
                         std::function<double(int, int)> value) {
  dem::RasterSpec spec;
  spec.width = size;
  spec.height = spacing == 1 ? size : (kPieces + 2 * kRim) / kBase;
  const double step = kStep * spacing;
  spec.geo_transform = {static_cast<double>(kFirstColumn + column) * kStep - 180 - step / 2, step, 0,
                        static_cast<double>(kFirstRow - row) * kStep - 90 + step / 2,        0,    -step};
  spec.nodata = -9999;
  spec.value = std::move(value);
  return dem::WriteRaster(dir, spec, name);
}

// Served heights at full resolution, at the samples that are visible or blended.
std::vector<Sample> BlendedSamples(const dem::ElevationModel& model) {
  std::vector<Sample> samples;
  const geo::Lattice lattice = model.LatticeOf(kLevel);
  EXPECT_EQ(lattice.cells, 256);
  const dem::NodeWindow window{kFirstColumn - kRim, kFirstRow - kPieces - kRim, 2 * kPieces + 2 * kRim,
                               kPieces + 2 * kRim};
  const auto heights = model.ReadNodes(kLevel, window);
  EXPECT_TRUE(heights.has_value());
  for (int y = kBase; y < window.rows - kBase; ++y) {
    for (int x = 0; x < window.columns - kBase; ++x) {
      const int column = x - kRim, row = kPieces + kRim - y;  // in samples of the pieces, from the north
      const bool is_piece = column >= 0 && column < 2 * kPieces && row >= 0 && row < kPieces && !IsHole(column, row);
      if (!is_piece && (column % kBase != 0 || row % kBase != 0)) continue;
      samples.push_back({lattice.Longitude(window.column + x), lattice.Latitude(window.row + y),
                         (*heights)[static_cast<std::size_t>(y) * static_cast<std::size_t>(window.columns) +
                                    static_cast<std::size_t>(x)]});
    }
  }
  return samples;
}

// Two adjacent pieces with a hole, over a base that is larger on all sides.
CertifiedCase Feathered(double feather, const std::string& vertical) {
  const auto make = [feather, vertical](const dem::TempDir& dir, std::string&) -> Source {
    CertifiedSource source;
    for (int piece = 0; piece < 2; ++piece) {
      const int left = piece * kPieces;
      source.files.push_back(
          {WriteAtNodes(dir, "piece" + std::to_string(piece) + ".tif", left, 0, kPieces, 1,
                        [left](int c, int r) { return IsHole(left + c, r) ? -9999 : Ground(left + c, r); })});
    }
    // The base is 25 m off and has no hills.
    source.files.push_back({WriteAtNodes(dir, "base.tif", -kRim, -kRim, (2 * kPieces + 2 * kRim) / kBase, kBase,
                                         [](int c, int r) {
                                           return 25 + 900 +
                                                  500 * std::sin((c * kBase - kRim) * .013) *
                                                      std::cos((r * kBase - kRim) * .011);
                                         }),
                            1});
    source.options.feather = feather;
    if (feather == 0) source.options.max_void_gap = 0;  // filled nodes would be neither samples nor blended
    source.options.source.vertical = vertical;
    const auto opened = dem::ElevationModel::Open(source.files, source.options);
    EXPECT_TRUE(opened.has_value());
    if (opened) source.samples = BlendedSamples(**opened);
    return source;
  };
  // Most of these tiles are in a feather, where the bound of each raster is computed separately: a wider feather has a
  // looser bound.
  return {fmt::format("feather {:.0f} m, {}", feather, vertical), make,
          feather == 0     ? 3.0
          : feather < 1000 ? 8.0
                           : 40.0};
}

// Slopes of 80 m a pixel along columns and of 40 along rows, up and down. They are planes between distant creases, so
// that only the positions of samples cause errors there.
double Zigzag(int at, int period) { return std::abs((at % period + period) % period - period / 2); }
double Steep(int column, int row) { return 500 + 80 * Zigzag(column + 50, 180) + 40 * Zigzag(row + 30, 180); }

// Pieces of a grid, each some pixels off it: by `east` and `south` at its north-western corner, and by `grow` more
// towards the opposite one.
struct Piece {
  int column, row, width, height;
  double east = 0, south = 0, grow = 0;
};

CertifiedSource WritePieces(const dem::TempDir& dir, const dem::RasterSpec& grid, const std::vector<Piece>& pieces) {
  CertifiedSource source;
  for (const Piece& piece : pieces) {
    dem::RasterSpec spec = grid;
    spec.width = piece.width, spec.height = piece.height;
    spec.geo_transform[0] += (piece.column + piece.east) * grid.geo_transform[1];
    spec.geo_transform[3] += (piece.row + piece.south) * grid.geo_transform[5];
    spec.geo_transform[1] *= 1 + piece.grow / piece.width;
    spec.geo_transform[5] *= 1 + piece.grow / piece.height;
    spec.value = [&piece](int c, int r) { return Steep(piece.column + c, piece.row + r); };
    source.files.push_back({dem::WriteRaster(dir, spec, fmt::format("piece{}.tif", source.files.size()))});
    for (const Sample& sample : SamplesOf(source.files.back().path)) source.samples.push_back(sample);
  }
  return source;
}

CertifiedCase Pieces(const std::string& name, const dem::RasterSpec& grid, std::vector<Piece> pieces) {
  return {name, [=](const dem::TempDir& dir, std::string&) { return WritePieces(dir, grid, pieces); }, 3, true};
}

// Samples around the antimeridian of rasters that close there.
CertifiedCase AtTheSeam(const std::string& name, const dem::RasterSpec& grid, std::vector<Piece> pieces) {
  const auto make = [=](const dem::TempDir& dir, std::string&) -> Source {
    CertifiedSource source = WritePieces(dir, grid, pieces);
    std::erase_if(source.samples,
                  [](const Sample& sample) { return std::abs(std::remainder(sample.longitude - 180, 360)) > 1; });
    return source;
  };
  return {name, make, 3, true};
}

}  // namespace

CertifiedSource FlatWorld(const dem::TempDir& dir) {
  CertifiedSource source;
  dem::RasterSpec spec;
  spec.width = 1440;
  spec.height = 720;
  spec.geo_transform = {-180, 0.25, 0, 90, 0, -0.25};
  spec.value = [](int, int) { return 0; };
  source.files.push_back({dem::WriteRaster(dir, spec, "flat.tif")});
  source.samples = SamplesOf(source.files.back().path);
  source.mesh_options = {tin::Criterion::kDataDependent, /*compact=*/true};
  return source;
}

std::vector<CertifiedCase> WrittenCases() {
  std::vector<CertifiedCase> cases = {{"sixteen small rasters", ManySmallGrids}};
  for (const double feather : {0.0, 400.0, 3000.0}) {
    for (const char* vertical : {"unknown", "egm96"}) cases.push_back(Feathered(feather, vertical));
  }
  return cases;
}

std::vector<CertifiedCase> NearlyAlignedCases() {
  std::vector<CertifiedCase> cases;
  dem::RasterSpec seconds;
  seconds.geo_transform = {7.25, 1.0 / 3600, 0, 46.5, 0, -1.0 / 3600};
  const std::vector<Piece> four = {{0, 0, 320, 256},
                                   {320, 0, 320, 256, .0099, -.0099},
                                   {0, 256, 320, 256, -.0099, .0099},
                                   {320, 256, 320, 256, .0099, .0099}};
  cases.push_back(Pieces("nearly aligned, degrees", seconds, four));
  // The blocks of their averages are not aligned.
  cases.push_back(Pieces("nearly aligned, odd sides", seconds,
                         {{0, 0, 301, 239}, {301, 0, 299, 239, .0099, .0099}, {0, 239, 301, 241, -.0099, -.0099}}));
  cases.push_back(
      Pieces("nearly the same pixels", seconds,
             {{0, 0, 320, 256, 0, 0, .0098}, {320, 0, 320, 256, .0098, .0098, -.0098}, {0, 256, 320, 256}}));
  dem::RasterSpec utm = seconds;
  utm.geo_transform = {400000, 30, 0, 5100000, 0, -30};
  utm.crs = "EPSG:32632";
  cases.push_back(Pieces("nearly aligned, UTM", utm, four));
  // Around the Earth: 360 degrees are not a whole number of columns.
  constexpr int kAround = 21600;
  const auto around = [](double off) {
    dem::RasterSpec globe;
    globe.geo_transform = {-180, 360 / (kAround + off), 0, 10, 0, -1.0 / 60};
    return globe;
  };
  cases.push_back(AtTheSeam("almost 21600 columns around", around(-.0095), {{0, 0, kAround, 64}}));
  cases.push_back(AtTheSeam("hardly 21600 columns around", around(.0095), {{0, 0, kAround, 64}}));
  cases.push_back(AtTheSeam("and some of them twice", around(.0095), {{0, 0, kAround + 11, 64}}));
  cases.push_back(AtTheSeam("around in two pieces", around(.005),
                            {{0, 0, kAround / 2, 64}, {kAround / 2, 0, kAround / 2, 64, -.0099, .0099}}));
  return cases;
}

}  // namespace terrace::tiler
