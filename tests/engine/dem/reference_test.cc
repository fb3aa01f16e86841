// If the lattice is at least as fine as the source, heights are equal to gdalwarp's: bilinear, at exact positions.
#include <gdal_priv.h>
#include <gdal_utils.h>

#include <cmath>

#include "tests/engine/dem/dem_fixture.h"

namespace terrace::dem {
namespace {

constexpr double kNodata = -32768;

// The tile's samples with halo as GDAL resamples them, rows from the NORTH.
std::vector<float> Warp(const std::string& path, const geo::Lattice& lattice, const geo::TileKey& key) {
  const double step = lattice.StepDegrees();
  const double west = lattice.Longitude(lattice.FirstColumn(key)) - 1.5 * step;
  const double south = lattice.Latitude(lattice.FirstRow(key)) - 1.5 * step;
  const int stride = lattice.cells + 3;
  const auto number = [](double value) { return fmt::format("{:.17g}", value); };
  std::vector<std::string> words = {"-of",
                                    "MEM",
                                    "-t_srs",
                                    "EPSG:4326",
                                    "-te",
                                    number(west),
                                    number(south),
                                    number(west + stride * step),
                                    number(south + stride * step),
                                    "-ts",
                                    std::to_string(stride),
                                    std::to_string(stride),
                                    "-r",
                                    "bilinear",
                                    "-et",
                                    "0",
                                    "-ot",
                                    "Float32",
                                    "-dstnodata",
                                    number(kNodata)};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  GDALDatasetH source = GDALOpen(path.c_str(), GA_ReadOnly);
  GDALWarpAppOptions* options = GDALWarpAppOptionsNew(arguments.data(), nullptr);
  GDALDatasetH warped = GDALWarp("", nullptr, 1, &source, options, nullptr);
  std::vector<float> heights(static_cast<std::size_t>(stride) * static_cast<std::size_t>(stride));
  EXPECT_EQ(GDALRasterIO(GDALGetRasterBand(warped, 1), GF_Read, 0, 0, stride, stride, heights.data(), stride, stride,
                         GDT_Float32, 0, 0),
            CE_None);
  GDALWarpAppOptionsFree(options);
  GDALClose(warped);
  GDALClose(source);
  return heights;
}

void ExpectAgreement(const std::string& path, const ElevationModel& model, const geo::TileKey& key) {
  const auto tile = model.Read(key);
  ASSERT_TRUE(tile) << tile.error().message;
  const std::vector<float> reference = Warp(path, tile->lattice, key);
  double worst = 0;
  std::size_t i = 0, compared = 0;
  for (int j = tile->lattice.cells + 1; j >= -1; --j) {
    for (int column = -1; column <= tile->lattice.cells + 1; ++column, ++i) {
      if (reference[i] == kNodata) continue;  // outside the source
      ++compared;
      worst = std::max(worst, std::abs(double{tile->At(column, j)} - reference[i]));
    }
  }
  EXPECT_GT(compared, reference.size() / 2) << geo::ToString(key);
  EXPECT_LT(worst, 0.001 + 1.0 / 2048) << geo::ToString(key);
}

TEST(Reference, HeightsAreThoseOfGdalwarp) {
  for (const std::string name : {"srtm3_S33W071_andes.tif", "lidar_greenriver_1m.tif", "bigtujunga_30m_utm11.tif",
                                 "webmercator_sf_float32.tif", "ortho_pair_dtm_2m_byte.tif", "SainteHelens.dem"}) {
    SCOPED_TRACE(name);
    TERRACE_REQUIRE_DATA(path, name);
    const auto source = OpenOrFail(path);
    ASSERT_NE(source, nullptr);
    int compared = 0;
    for (int level = source->max_level(); level > source->max_level() - 3; --level) {
      const geo::TileRange range = TilesWithData(*source, level).front();
      for (const int share : {1, 2, 3}) {
        const geo::TileKey key{level, range.start_x + (range.end_x - range.start_x) * share / 4,
                               range.start_y + (range.end_y - range.start_y) * (4 - share) / 4};
        // Along the source's edge GDAL's rule differs.
        if (key.x <= range.start_x || key.x >= range.end_x || key.y <= range.start_y || key.y >= range.end_y) continue;
        ExpectAgreement(path, *source, key);
        ++compared;
      }
    }
    EXPECT_GE(compared, 3);
  }
}

}  // namespace
}  // namespace terrace::dem
