// The error bound on every real elevation model, for every way to make a mesh, measured by an independent rasterizer.
// Of rasters with more than 1.5 million samples a window at the centre is tested; with the environment variable
// TERRACE_LONG_TESTS=1 the whole raster. Prints one line for each mesh: vertices, largest error divided by the bound,
// seconds.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <ostream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/decimate/drop_pass.h"
#include "engine/tin/extended/block_joiner.h"
#include "engine/tin/extended/field_partition.h"
#include "engine/tin/greedy.h"
#include "tests/engine/tin/rasterizer.h"
#include "tests/support/test_data.h"

namespace terrace::tin {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::int64_t kMaxSamples = 1'500'000;
constexpr int kWindow = 801;
constexpr int kBlock = 256;

struct Dem {
  const char* file;
  int width, height;  // of the whole raster
};

// In this order three shards have about the same work.
constexpr Dem kDems[] = {
    {"N43E007.hgt.zip", 1201, 1201},
    {"SainteHelens.dem", 327, 468},
    {"antimeridian_hawaii_topobathy_5min.tif", 725, 534},
    {"ashby.tif", 346, 452},
    {"azores_topobathy_1min_float32.tif", 601, 451},
    {"bigtujunga_30m_utm11.tif", 1197, 643},
    {"crater.tif", 336, 459},
    {"etopo1_global_1deg_float32.tif", 361, 181},
    {"etopo5_global_10min.tif", 2160, 1081},
    {"greenland_80N_100m_custom_tm.tif", 245, 302},
    {"lidar_greenriver_1m.tif", 2000, 1000},
    {"lidar_slovenia_1m_nodata.tif", 1000, 1000},
    {"n43e007.dt0", 121, 121},
    {"ntc.tif", 1024, 1024},
    {"ortho_pair_dtm_2m_byte.tif", 900, 900},
    {"ozark.tif", 369, 462},
    {"pole_antarctica_bedmap_5km.tif", 1333, 1333},
    {"srtm1_N20W156_hana_kohala.tif", 3601, 3601},
    {"srtm1_N20W157_maui_se_haleakala.tif", 3601, 3601},
    {"srtm1_N20W158_maui_sw.tif", 3601, 3601},
    {"srtm1_N21W157_maui_ne_molokai.tif", 3601, 3601},
    {"srtm1_N21W158_maui_nw_molokai.tif", 3601, 3601},
    {"srtm1_N48W125_cape_flattery_half_void.tif", 3601, 3601},
    {"srtm1_N51E179_antimeridian_w.tif", 3601, 3601},
    {"srtm3_N46E008_swiss_alps.tif", 1201, 1201},
    {"srtm1_N51W180_antimeridian_e.tif", 3601, 3601},
    {"srtm3_S33W071_andes.tif", 1201, 1201},
    {"webmercator_sf_float32.tif", 512, 512},
    {"westUS.tif", 1024, 1024},
};

std::ostream& operator<<(std::ostream& out, const Dem& dem) { return out << dem.file; }

bool AreLongTestsWanted() {
  const char* wanted = std::getenv("TERRACE_LONG_TESTS");
  return wanted != nullptr && std::string_view(wanted) == "1";
}

Result<HeightField> Read(const Dem& dem) {
  const bool is_whole = std::int64_t{dem.width} * dem.height <= kMaxSamples || AreLongTestsWanted();
  const int width = is_whole ? dem.width : std::min(kWindow, dem.width);
  const int height = is_whole ? dem.height : std::min(kWindow, dem.height);
  auto raster =
      test_support::ReadTestRaster(dem.file, (dem.width - width) / 2, (dem.height - height) / 2, width, height);
  if (!raster) return MakeError(ErrorCode::kUnavailable, "{}: cannot be read", dem.file);
  return HeightField::Make(raster->width, raster->height, std::move(raster->heights));
}

// Coarse to fine, because a continued run ends in the mesh of one run.
std::vector<double> ErrorsOf(const Dem& dem) {
  std::vector<double> errors = {20, 5, 1};
  if (std::string_view(dem.file).starts_with("lidar_")) errors.push_back(0.1);
  return errors;
}

class RealBounds : public testing::TestWithParam<Dem> {
 protected:
  // Measures the time of `make`.
  template <typename Make>
  TinMesh Expect(const HeightField& field, const char* way, double error, Make&& make) {
    const Clock::time_point start = Clock::now();
    TinMesh mesh = make();
    const std::chrono::duration<double> seconds = Clock::now() - start;
    const Rasterization raster = Rasterize(field, mesh);
    EXPECT_TRUE(Keeps(raster, error)) << GetParam().file << ", " << way << " at " << error << " m";
    fmt::print("{} | {} x {} | {} | {} | {} | {:.9f} | {:.2f}\n", GetParam().file, field.width(), field.height(), way,
               error, mesh.vertices.size(), raster.max_error / error, seconds.count());
    return mesh;
  }
};

TinMesh MeshInBlocks(const HeightField& field, double error, Criterion criterion) {
  FieldPartition cut = FieldPartition::For(field, error);
  if (cut.size() == 1)
    cut = FieldPartition(field.width(), field.height(), kBlock);  // also if one block would be better
  BlockJoiner joiner(cut);
  GreedyOptions options;
  options.criterion = criterion;
  for (std::size_t i = 0; i < cut.size(); ++i) joiner.Add(*MeshBlock(field, cut.block(i), error, options));
  return std::move(joiner).Take();
}

TEST_P(RealBounds, HoldAtEverySample) {
  if (!test_support::TestDataPath(GetParam().file)) GTEST_SKIP() << test_support::MissingTestData(GetParam().file);
  const Result<HeightField> field = Read(GetParam());
  ASSERT_TRUE(field.has_value()) << field.error().message;
  const bool is_cut = field->width() > kBlock + 1 && field->height() > kBlock + 1;
  GreedyOptions fitted;
  fitted.criterion = Criterion::kDataDependent;
  GreedyTriangulation delaunay(*field), data_dependent(*field, fitted);
  for (const double error : ErrorsOf(GetParam())) {
    const auto run = [&](GreedyTriangulation& tin) {
      EXPECT_TRUE(tin.Run({error}));
      return tin.Mesh();
    };
    const TinMesh mesh = Expect(*field, "Delaunay", error, [&] { return run(delaunay); });
    Expect(*field, "compact", error, [&] { return *DropVertices(*field, mesh, {.max_error = error}); });
    Expect(*field, "data-dependent", error, [&] { return run(data_dependent); });
    if (!is_cut) continue;
    Expect(*field, "cut", error, [&] { return MeshInBlocks(*field, error, Criterion::kDelaunay); });
  }
}

std::string NameOf(const testing::TestParamInfo<Dem>& info) {
  std::string name;
  for (const char c : std::string_view(info.param.file)) name += std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
}

INSTANTIATE_TEST_SUITE_P(Dem, RealBounds, testing::ValuesIn(kDems), NameOf);

}  // namespace
}  // namespace terrace::tin
