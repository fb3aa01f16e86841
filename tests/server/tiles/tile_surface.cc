#include "tests/server/tiles/tile_surface.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <cmath>
#include <memory>

namespace terrace::server {

std::vector<Sample> SamplesOf(const std::string& path) {
  GDALAllRegister();
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER));
  GDALRasterBand& band = *dataset->GetRasterBand(1);
  const int width = band.GetXSize(), height = band.GetYSize();
  std::vector<float> heights(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  EXPECT_EQ(band.RasterIO(GF_Read, 0, 0, width, height, heights.data(), width, height, GDT_Float32, 0, 0, nullptr),
            CE_None);
  int has_nodata = 0;
  const double nodata = band.GetNoDataValue(&has_nodata);
  std::array<double, 6> transform{};
  dataset->GetGeoTransform(transform.data());
  OGRSpatialReference from(*dataset->GetSpatialRef()), to;
  to.SetWellKnownGeogCS("WGS84");
  from.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  to.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  const bool geographic = from.IsGeographic() != 0;
  const std::unique_ptr<OGRCoordinateTransformation> place(OGRCreateCoordinateTransformation(&from, &to));
  std::vector<Sample> samples;
  std::vector<double> x(static_cast<std::size_t>(width)), y(x);
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      const double c = column + 0.5, r = row + 0.5;
      x[static_cast<std::size_t>(column)] = transform[0] + c * transform[1] + r * transform[2];
      y[static_cast<std::size_t>(column)] = transform[3] + c * transform[4] + r * transform[5];
    }
    if (!geographic) place->Transform(width, x.data(), y.data());
    for (int column = 0; column < width; ++column) {
      const double sample = heights[static_cast<std::size_t>(row) * x.size() + static_cast<std::size_t>(column)];
      if (std::isnan(sample) || std::abs(sample) > 99998 || (has_nodata != 0 && sample == nodata)) continue;
      if (has_nodata == 0 && sample == -32768) continue;
      const auto at = static_cast<std::size_t>(column);
      samples.push_back({x[at], y[at], sample});
    }
  }
  return samples;
}

TileSurface::TileSurface(const proto::DecodedTile& mesh, const geo::TileKey& key) : mesh_(mesh), bins_(kBins * kBins) {
  side_ = 180.0 / static_cast<double>(geo::TileRows(key.level));
  west_ = side_ * static_cast<double>(key.x) - 180;
  south_ = side_ * static_cast<double>(key.y) - 90;
  for (std::size_t k = 0; k < mesh.u.size(); ++k) {
    ecef_.push_back(
        geo::ToEcef(west_ + side_ * mesh.u[k] / 32767.0, south_ + side_ * mesh.v[k] / 32767.0, HeightOf(k)));
  }
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    int low_u = 32767, high_u = 0, low_v = 32767, high_v = 0;
    for (const std::uint32_t k : mesh.triangles[t]) {
      low_u = std::min(low_u, mesh.u[k]), high_u = std::max(high_u, mesh.u[k]);
      low_v = std::min(low_v, mesh.v[k]), high_v = std::max(high_v, mesh.v[k]);
    }
    for (int v = BinOf(low_v); v <= BinOf(high_v); ++v) {
      for (int u = BinOf(low_u); u <= BinOf(high_u); ++u) bins_[static_cast<std::size_t>(v * kBins + u)].push_back(t);
    }
  }
}

double TileSurface::ErrorAt(const Sample& sample) const {
  double longitude = sample.longitude - west_;
  longitude -= 360 * std::floor(longitude / 360);
  const double u = longitude / side_ * 32767, v = (sample.latitude - south_) / side_ * 32767;
  if (!(u >= 0 && u <= 32767 && v >= 0 && v <= 32767)) return -1;
  double error = -1;
  for (const std::size_t t : bins_[static_cast<std::size_t>(BinOf(v) * kBins + BinOf(u))]) {
    const std::array<std::uint32_t, 3>& k = mesh_.triangles[t];
    const auto cross = [&](std::size_t a, std::size_t b) {
      return (mesh_.u[k[a]] - u) * (mesh_.v[k[b]] - v) - (mesh_.v[k[a]] - v) * (mesh_.u[k[b]] - u);
    };
    const double w0 = cross(1, 2), w1 = cross(2, 0), w2 = cross(0, 1), sum = w0 + w1 + w2;
    if (w0 < 0 || w1 < 0 || w2 < 0 || sum <= 0) continue;
    const double sampled = (w0 * HeightOf(k[0]) + w1 * HeightOf(k[1]) + w2 * HeightOf(k[2])) / sum;
    const geo::Vec3 point = (ecef_[k[0]] * w0 + ecef_[k[1]] * w1 + ecef_[k[2]] * w2) * (1 / sum);
    const double drawn = geo::Dot(point - geo::ToEcef(sample.longitude, sample.latitude, 0),
                                  geo::SurfaceNormal(sample.longitude, sample.latitude));
    error = std::max({error, std::abs(sampled - sample.height), std::abs(drawn - sample.height)});
  }
  return error;
}

double TileSurface::LargestError(const std::vector<Sample>& samples) const {
  double largest = -1;
  for (const Sample& sample : samples) largest = std::max(largest, ErrorAt(sample));
  return largest;
}

int TileSurface::BinOf(double at) { return std::clamp(static_cast<int>(at * kBins / 32768), 0, kBins - 1); }

double TileSurface::HeightOf(std::size_t k) const {
  return double{mesh_.min_height} + (double{mesh_.max_height} - double{mesh_.min_height}) * mesh_.h[k] / 32767.0;
}

}  // namespace terrace::server
