#include "tests/tiler/source_samples.h"

#include <gdal_priv.h>
#include <gtest/gtest.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>

namespace terrace::tiler {
namespace {

// A raster's first band as GDAL reads it.
class Raster {
 public:
  explicit Raster(const std::string& path) {
    GDALAllRegister();
    dataset_.reset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER));
    GDALRasterBand& band = *dataset_->GetRasterBand(1);
    width_ = band.GetXSize(), height_ = band.GetYSize();
    heights_.resize(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    EXPECT_EQ(
        band.RasterIO(GF_Read, 0, 0, width_, height_, heights_.data(), width_, height_, GDT_Float32, 0, 0, nullptr),
        CE_None);
    int has_nodata = 0;
    nodata_ = band.GetNoDataValue(&has_nodata);
    has_nodata_ = has_nodata != 0;
    dataset_->GetGeoTransform(transform_.data());
    EXPECT_TRUE(GDALInvGeoTransform(transform_.data(), inverse_.data()));
    OGRSpatialReference of_raster(*dataset_->GetSpatialRef()), wgs84;
    wgs84.SetWellKnownGeogCS("WGS84");
    of_raster.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    wgs84.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    if (of_raster.IsGeographic() != 0) return;
    to_degrees_.reset(OGRCreateCoordinateTransformation(&of_raster, &wgs84));
    from_degrees_.reset(OGRCreateCoordinateTransformation(&wgs84, &of_raster));
  }

  int width() const { return width_; }
  int height() const { return height_; }

  double At(int column, int row) const {
    return heights_[static_cast<std::size_t>(row) * static_cast<std::size_t>(width_) +
                    static_cast<std::size_t>(column)];
  }
  bool IsValid(int column, int row) const {
    const double sample = At(column, row);
    if (std::isnan(sample) || std::abs(sample) > 99998) return false;
    return has_nodata_ ? sample != nodata_ : sample != -32768;
  }

  // Positions of the centres of a row's pixels, in degrees.
  void GridCoordinatesOf(int row, std::vector<double>& x, std::vector<double>& y) const {
    x.resize(static_cast<std::size_t>(width_)), y.resize(x.size());
    for (std::size_t column = 0; column < x.size(); ++column) {
      const double c = static_cast<double>(column) + 0.5, r = row + 0.5;
      x[column] = transform_[0] + c * transform_[1] + r * transform_[2];
      y[column] = transform_[3] + c * transform_[4] + r * transform_[5];
    }
    if (to_degrees_) to_degrees_->Transform(width_, x.data(), y.data());
  }

  // The pixel at a position, which may be outside the raster.
  std::array<double, 2> PixelAt(double longitude, double latitude) const {
    double x = longitude, y = latitude;
    if (from_degrees_ && from_degrees_->Transform(1, &x, &y) == 0) return {-1, -1};
    if (!from_degrees_) {
      const double centre = transform_[0] + width_ / 2.0 * transform_[1];
      x -= 360 * std::round((x - centre) / 360);
    }
    const double column = inverse_[0] + x * inverse_[1] + y * inverse_[2];
    const double row = inverse_[3] + x * inverse_[4] + y * inverse_[5];
    return std::isfinite(column) && std::isfinite(row) ? std::array{column, row} : std::array{-1.0, -1.0};
  }

 private:
  GDALDatasetUniquePtr dataset_;
  std::unique_ptr<OGRCoordinateTransformation> to_degrees_, from_degrees_;  // null: the raster is in degrees
  std::vector<float> heights_;
  std::array<double, 6> transform_{}, inverse_{};  // pixels to the reference system, and back
  int width_ = 0, height_ = 0;
  double nodata_ = 0;
  bool has_nodata_ = false;
};

}  // namespace

std::vector<Sample> SamplesOf(const std::string& path) {
  const Raster raster(path);
  std::vector<Sample> samples;
  std::vector<double> x, y;
  for (int row = 0; row < raster.height(); ++row) {
    raster.GridCoordinatesOf(row, x, y);
    for (int column = 0; column < raster.width(); ++column) {
      const auto at = static_cast<std::size_t>(column);
      if (raster.IsValid(column, row) && std::isfinite(x[at]))
        samples.push_back({x[at], y[at], raster.At(column, row)});
    }
  }
  return samples;
}

std::vector<Sample> Outside(const std::vector<Sample>& samples, const std::string& path) {
  constexpr int kNear = 70;  // pixels: more than max_void_gap
  const Raster raster(path);
  const int width = raster.width(), height = raster.height();
  // Valid pixels above and to the left.
  const auto stride = static_cast<std::size_t>(width + 1);
  std::vector<std::int64_t> valid(stride * static_cast<std::size_t>(height + 1));
  const auto at = [stride](int column, int row) {
    return static_cast<std::size_t>(row) * stride + static_cast<std::size_t>(column);
  };
  for (int row = 0; row < height; ++row) {
    for (int column = 0; column < width; ++column) {
      valid[at(column + 1, row + 1)] = valid[at(column, row + 1)] + valid[at(column + 1, row)] -
                                       valid[at(column, row)] + (raster.IsValid(column, row) ? 1 : 0);
    }
  }
  std::vector<Sample> outside;
  for (const Sample& sample : samples) {
    const auto [x, y] = raster.PixelAt(sample.longitude, sample.latitude);
    if (x >= 0 && y >= 0 && x < width && y < height) {
      const int column = static_cast<int>(x), row = static_cast<int>(y);
      const int west = std::max(column - kNear, 0), east = std::min(column + kNear, width);
      const int north = std::max(row - kNear, 0), south = std::min(row + kNear, height);
      if (valid[at(east, south)] - valid[at(west, south)] - valid[at(east, north)] + valid[at(west, north)] > 0)
        continue;
    }
    outside.push_back(sample);
  }
  return outside;
}

SampleIndex::SampleIndex(std::vector<Sample> samples) {
  double east = -180, north = -90;
  const std::size_t count = samples.size();
  for (std::size_t i = 0; i < count; ++i) {
    double& longitude = samples[i].longitude;
    longitude -= 360 * std::round(longitude / 360);
    if (std::abs(longitude) == 180) {
      Sample other = samples[i];
      other.longitude = -longitude;
      samples.push_back(other);
    }
  }
  for (const Sample& sample : samples) {
    west_ = std::min(west_, sample.longitude), east = std::max(east, sample.longitude);
    south_ = std::min(south_, sample.latitude), north = std::max(north, sample.latitude);
  }
  width_ = east - west_, height_ = north - south_;
  const auto bin = [&](const Sample& sample) {
    return BinOf(sample.latitude - south_, height_) * kBins + BinOf(sample.longitude - west_, width_);
  };
  first_.assign(kBins * kBins + 1, 0);
  for (const Sample& sample : samples) ++first_[bin(sample) + 1];
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  samples_.resize(samples.size());
  std::vector<std::size_t> next = first_;
  for (const Sample& sample : samples) samples_[next[bin(sample)]++] = sample;
}

std::size_t SampleIndex::BinOf(double at, double size) {
  const double bin = size > 0 ? std::floor(at / size * kBins) : 0;
  return static_cast<std::size_t>(std::clamp(bin, 0.0, kBins - 1.0));
}

}  // namespace terrace::tiler
