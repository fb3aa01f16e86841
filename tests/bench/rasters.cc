#include "tests/bench/rasters.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <iostream>
#include <set>
#include <utility>

#include "engine/core/check.h"
#include "engine/mosaic/void_fill.h"
#include "tests/support/source_dir.h"
#include "tests/support/test_data.h"

namespace terrace::bench {
namespace {

constexpr int kMaxVoidGap = 64;  // samples

std::string PathOf(const std::string& name) {
  const std::filesystem::path sample = test_support::SourceDir() / "config" / "samples" / name;
  return std::filesystem::exists(sample) ? sample.string() : name;
}

tin::HeightField MakeField(int width, int height, std::vector<float> heights) {
  Result<tin::HeightField> field = tin::HeightField::Make(width, height, std::move(heights));
  TERRACE_CHECK(field.has_value());
  return *std::move(field);
}

}  // namespace

std::optional<tin::HeightField> ReadField(const std::string& name, const Window& window) {
  std::optional<test_support::TestRaster> raster =
      test_support::ReadTestRaster(PathOf(name), window.x, window.y, window.width, window.height);
  if (!raster) {
    static std::set<std::string> missed;
    if (missed.insert(name).second) std::cerr << test_support::MissingTestData(name) << std::endl;
    return std::nullopt;
  }
  const dem::GridWindow all{0, 0, raster->width, raster->height};
  std::vector<float> heights = dem::FillVoids(raster->heights, all, all, kMaxVoidGap);
  for (float& height : heights) {
    height = std::isnan(height) ? 0 : std::nearbyint(height * 1024) / 1024;  // as dem::ElevationModel rounds heights
  }
  return MakeField(raster->width, raster->height, std::move(heights));
}

std::span<const Area> TileAreas() {
  static const std::array<Area, 4> areas = {{
      {"alps", "srtm3_N46E008_swiss_alps.tif", {{0, 0}, {826, 944}, {354, 826}, {826, 354}}},
      {"andes", "srtm3_S33W071_andes.tif", {{100, 100}, {500, 300}, {800, 800}, {300, 850}}},
      {"crater", "crater.tif", {{0, 0}, {79, 202}}},
      {"west-us", "westUS.tif", {{0, 0}, {500, 200}, {700, 700}, {200, 600}}},
  }};
  return areas;
}

std::optional<std::vector<tin::HeightField>> ReadTiles(const Area& area) {
  std::vector<tin::HeightField> fields;
  for (const auto& [x, y] : area.corners) {
    std::optional<tin::HeightField> field = ReadField(area.file, {x, y, kTileSide, kTileSide});
    if (!field) return std::nullopt;
    fields.push_back(*std::move(field));
  }
  return fields;
}

std::span<const char* const> TileRasters() {
  static constexpr std::array kFiles = {"azores_topobathy_1min_float32.tif",
                                        "antimeridian_hawaii_topobathy_5min.tif",
                                        "etopo5_global_10min.tif",
                                        "pole_antarctica_bedmap_5km.tif",
                                        "srtm3_N46E008_swiss_alps.tif",
                                        "srtm3_S33W071_andes.tif",
                                        "jacksboro.tif",
                                        "westUS.tif",
                                        "SainteHelens.dem",
                                        "bigtujunga_30m_utm11.tif",
                                        "crater.tif",
                                        "ashby.tif",
                                        "ntc.tif",
                                        "ozark.tif",
                                        "srtm1_N20W156_hana_kohala.tif",
                                        "srtm1_N20W157_maui_se_haleakala.tif",
                                        "srtm1_N20W158_maui_sw.tif",
                                        "srtm1_N21W157_maui_ne_molokai.tif",
                                        "srtm1_N21W158_maui_nw_molokai.tif",
                                        "srtm1_N48W125_cape_flattery_half_void.tif",
                                        "srtm1_N51E179_antimeridian_w.tif",
                                        "srtm1_N51W180_antimeridian_e.tif",
                                        "webmercator_sf_float32.tif",
                                        "ortho_pair_dtm_2m_byte.tif",
                                        "lidar_greenriver_1m.tif",
                                        "lidar_slovenia_1m_nodata.tif"};
  return kFiles;
}

std::optional<std::vector<tin::HeightField>> ReadQuarterTiles(const char* file) {
  const std::optional<tin::HeightField> raster = ReadField(file);
  if (!raster || std::min(raster->width(), raster->height()) < kTileSide) return std::nullopt;
  const auto first = [](int size, int quarter) {
    return std::clamp(size * quarter / 4 - kTileSide / 2, 0, size - kTileSide);
  };
  std::vector<tin::HeightField> fields;
  for (const int south : {1, 3}) {
    for (const int west : {1, 3}) {
      const int left = first(raster->width(), west), bottom = first(raster->height(), south);
      std::vector<float> heights;
      for (int y = bottom; y < bottom + kTileSide; ++y) {
        heights.insert(heights.end(), raster->Row(y) + left, raster->Row(y) + left + kTileSide);
      }
      const auto [low, high] = std::minmax_element(heights.begin(), heights.end());
      if (*high - *low >= 1) fields.push_back(MakeField(kTileSide, kTileSide, std::move(heights)));
    }
  }
  if (fields.empty()) return std::nullopt;
  return fields;
}

std::span<const LargeRaster> LargeRasters() {
  static const std::array<LargeRaster, 6> rasters = {{
      {"jacksboro 403x344", "jacksboro.tif", {}, false},
      {"west-us 1024x1024", "westUS.tif", {}, false},
      {"ntc 1024x1024", "ntc.tif", {}, false},
      {"andes mirrored 2401x2401", "srtm3_S33W071_andes.tif", {}, true},
      {"maui 2401x2401", "srtm1_N20W157_maui_se_haleakala.tif", {1200, 0, 2401, 2401}, false},
      {"maui 3601x3601", "srtm1_N20W157_maui_se_haleakala.tif", {}, false},
  }};
  return rasters;
}

std::optional<tin::HeightField> ReadLarge(const LargeRaster& raster) {
  std::optional<tin::HeightField> field = ReadField(raster.file, raster.window);
  if (field && raster.is_mirrored) return MirroredFourfold(*field);
  return field;
}

tin::HeightField MirroredFourfold(const tin::HeightField& field) {
  const int width = 2 * field.width() - 1, height = 2 * field.height() - 1;
  std::vector<float> heights;
  heights.reserve(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      heights.push_back(field.At(x < field.width() ? x : width - 1 - x, y < field.height() ? y : height - 1 - y));
    }
  }
  return MakeField(width, height, std::move(heights));
}

}  // namespace terrace::bench
