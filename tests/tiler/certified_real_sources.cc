#include <gdal_priv.h>
#include <gdal_utils.h>
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <utility>

#include "engine/crs/geoid.h"
#include "tests/support/test_data.h"
#include "tests/tiler/certified_sources.h"

namespace terrace::tiler {
namespace {

using Source = std::optional<CertifiedSource>;

// Paths of real rasters; nothing if one of them is missing.
std::optional<std::vector<std::string>> Find(const std::vector<std::string>& names, std::string& missing) {
  std::vector<std::string> paths;
  for (const std::string& name : names) {
    const auto path = test_support::TestDataPath(name);
    if (!path) {
      missing = test_support::MissingTestData(name);
      return std::nullopt;
    }
    paths.push_back(*path);
  }
  return paths;
}

// A window of a raster, written as a separate file.
struct Window {
  int column, row, columns, rows;
};

// `off`: pixels by which its corner is moved to the east and to the south; the opposite corner is moved by as much
// again.
struct Move {
  double column = 0, row = 0, grow = 0;
};

std::string Cut(const std::string& from, const std::string& to, const Window& window, const Move& move = {}) {
  GDALAllRegister();
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(from.c_str(), GDAL_OF_RASTER));
  EXPECT_NE(dataset, nullptr) << from;
  std::vector<std::string> words = {"-srcwin", std::to_string(window.column), std::to_string(window.row),
                                    std::to_string(window.columns), std::to_string(window.rows)};
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  GDALTranslateOptions* const options = GDALTranslateOptionsNew(arguments.data(), nullptr);
  const GDALDatasetUniquePtr cut(
      GDALDataset::FromHandle(GDALTranslate(to.c_str(), GDALDataset::ToHandle(dataset.get()), options, nullptr)));
  GDALTranslateOptionsFree(options);
  EXPECT_NE(cut, nullptr) << to;
  if (move.column == 0 && move.row == 0 && move.grow == 0) return to;
  std::array<double, 6> transform{};
  cut->GetGeoTransform(transform.data());
  transform[0] += move.column * transform[1];
  transform[3] += move.row * transform[5];
  transform[1] *= 1 + move.grow / window.columns;
  transform[5] *= 1 + move.grow / window.rows;
  cut->SetGeoTransform(transform.data());
  return to;
}

void AddOverviews(const std::string& path) {
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER | GDAL_OF_UPDATE));
  ASSERT_NE(dataset, nullptr);
  std::array<int, 4> factors = {2, 4, 8, 16};
  EXPECT_EQ(dataset->BuildOverviews("AVERAGE", 4, factors.data(), 0, nullptr, GDALDummyProgress, nullptr), CE_None);
}

void Append(std::vector<Sample>& samples, const std::vector<Sample>& more) {
  samples.insert(samples.end(), more.begin(), more.end());
}

// Converts the samples from EGM96, because served heights are above the ellipsoid.
void CountFromEgm96(CertifiedSource& source) {
  source.options.source.vertical = "egm96";
  const Sample& some = source.samples.front();
  const auto geoid = dem::Geoid::OfCrs("EPSG:5773", {some.longitude, some.latitude});
  ASSERT_TRUE(geoid.has_value());
  const dem::Geoid::Reader reader(**geoid);
  for (Sample& sample : source.samples) sample.height += reader.At({sample.longitude, sample.latitude});
}

CertifiedCase Alone(const std::string& name, bool above_egm96 = false) {
  return {name + (above_egm96 ? ", EGM96" : ""),
          [name, above_egm96](const dem::TempDir&, std::string& missing) -> Source {
            const auto paths = Find({name}, missing);
            if (!paths) return std::nullopt;
            CertifiedSource source{{{paths->front()}}, {}, SamplesOf(paths->front())};
            if (above_egm96) CountFromEgm96(source);
            return source;
          }};
}

// Samples of the first files count everywhere, those of the last one outside the first ones.
void AddOver(CertifiedSource& source, const std::string& base) {
  std::vector<Sample> shown = SamplesOf(base);
  for (const dem::DemFile& file : source.files) {
    Append(source.samples, SamplesOf(file.path));
    shown = Outside(shown, file.path);
  }
  source.files.push_back({base, 1});
  Append(source.samples, shown);
}

CertifiedCase Over(const std::string& name, const std::string& base) {
  return {name + " over " + base, [name, base](const dem::TempDir&, std::string& missing) -> Source {
            const auto paths = Find({name, base}, missing);
            if (!paths) return std::nullopt;
            CertifiedSource source{{{(*paths)[0], 0}}};
            AddOver(source, (*paths)[1]);
            return source;
          }};
}

// Four pieces of a raster, cut in the middle, each displaced.
CertifiedCase MovedPieces(const std::string& name, int columns, int rows) {
  return {
      "moved pieces of " + name, [name, columns, rows](const dem::TempDir& dir, std::string& missing) -> Source {
        const auto paths = Find({name}, missing);
        if (!paths) return std::nullopt;
        const int left = columns / 2 / 64 * 64, top = rows / 2 / 64 * 64;
        const std::array<Window, 4> windows = {{{0, 0, left, top},
                                                {left, 0, columns - left, top},
                                                {0, top, left, rows - top},
                                                {left, top, columns - left, rows - top}}};
        constexpr std::array<Move, 4> kMoves = {{{}, {.009, -.009}, {-.009, .009}, {.004, .004, .005}}};
        CertifiedSource source;
        for (std::size_t i = 0; i < windows.size(); ++i) {
          source.files.push_back({Cut(paths->front(), dir.File(std::to_string(i) + ".tif"), windows[i], kMoves[i])});
          Append(source.samples, SamplesOf(source.files.back().path));
        }
        return source;
      }};
}

// The corners of four tiles of one degree around their common corner.
constexpr int kSide = 641;
constexpr std::array<std::pair<const char*, std::array<int, 2>>, 4> kCorners = {{
    {"srtm1_N21W158_maui_nw_molokai.tif", {3601 - kSide, 3601 - kSide}},
    {"srtm1_N21W157_maui_ne_molokai.tif", {0, 3601 - kSide}},
    {"srtm1_N20W158_maui_sw.tif", {3601 - kSide, 0}},
    {"srtm1_N20W157_maui_se_haleakala.tif", {0, 0}},
}};

Source MauiOverBase(const dem::TempDir& dir, std::string& missing, bool overviews, bool above_egm96) {
  CertifiedSource source;
  for (const auto& [name, corner] : kCorners) {
    const auto paths = Find({name}, missing);
    if (!paths) return std::nullopt;
    source.files.push_back({Cut(paths->front(), dir.File(name), {corner[0], corner[1], kSide, kSide})});
  }
  const auto base = Find({"etopo5_global_10min.tif"}, missing);
  if (!base) return std::nullopt;
  AddOver(source, base->front());
  // Pieces have 641 samples a side, which no factor divides.
  for (const dem::DemFile& file : source.files) {
    if (overviews && file.rank == 0) AddOverviews(file.path);
  }
  if (above_egm96) CountFromEgm96(source);
  return source;
}

Source CutOfMaui(const dem::TempDir& dir, std::string& missing, std::size_t which) {
  const auto& [name, corner] = kCorners[which];
  const auto paths = Find({name}, missing);
  if (!paths) return std::nullopt;
  CertifiedSource source{{{Cut(paths->front(), dir.File(name), {corner[0], corner[1], kSide, kSide})}}};
  AddOverviews(source.files.front().path);
  source.samples = SamplesOf(source.files.front().path);
  return source;
}

Source AcrossTheAntimeridian(const dem::TempDir& dir, std::string& missing) {
  const auto paths = Find({"srtm1_N51E179_antimeridian_w.tif", "srtm1_N51W180_antimeridian_e.tif"}, missing);
  if (!paths) return std::nullopt;
  CertifiedSource source;
  source.files = {{Cut((*paths)[0], dir.File("west.tif"), {3601 - 1200, 900, 1200, 1200})},
                  {Cut((*paths)[1], dir.File("east.tif"), {0, 900, 1200, 1200})}};
  for (const dem::DemFile& file : source.files) Append(source.samples, SamplesOf(file.path));
  return source;
}

}  // namespace

std::vector<CertifiedCase> RealCases() {
  std::vector<CertifiedCase> cases;
  for (const char* name :
       {"srtm3_N46E008_swiss_alps.tif", "srtm3_S33W071_andes.tif", "srtm1_N48W125_cape_flattery_half_void.tif",
        "n43e007.dt0", "bigtujunga_30m_utm11.tif", "lidar_slovenia_1m_nodata.tif", "lidar_greenriver_1m.tif",
        "ortho_pair_dtm_2m_byte.tif", "webmercator_sf_float32.tif", "greenland_80N_100m_custom_tm.tif",
        "pole_antarctica_bedmap_5km.tif", "etopo5_global_10min.tif", "etopo1_global_1deg_float32.tif",
        "antimeridian_hawaii_topobathy_5min.tif", "azores_topobathy_1min_float32.tif"}) {
    cases.push_back(Alone(name));
  }
  cases.push_back(Alone("srtm3_N46E008_swiss_alps.tif", true));
  cases.push_back(Alone("etopo5_global_10min.tif", true));
  cases.push_back(MovedPieces("srtm3_S33W071_andes.tif", 1201, 1201));
  cases.push_back(MovedPieces("bigtujunga_30m_utm11.tif", 1197, 643));
  cases.push_back(Over("pole_antarctica_bedmap_5km.tif", "etopo5_global_10min.tif"));
  cases.push_back(Over("lidar_greenriver_1m.tif", "etopo5_global_10min.tif"));
  cases.push_back({"across the antimeridian", AcrossTheAntimeridian});
  const auto maui = [&cases](const char* name, bool overviews, bool above_egm96) {
    cases.push_back({name, [=](const dem::TempDir& dir, std::string& missing) {
                       return MauiOverBase(dir, missing, overviews, above_egm96);
                     }});
  };
  maui("four tiles over a base", false, false);
  maui("the same with overviews", true, false);
  maui("the same above EGM96", true, true);
  for (const std::size_t one : {0, 3}) {
    cases.push_back({kCorners[one].first + std::string(", with overviews"),
                     [one](const dem::TempDir& dir, std::string& missing) { return CutOfMaui(dir, missing, one); }});
  }
  return cases;
}

}  // namespace terrace::tiler
