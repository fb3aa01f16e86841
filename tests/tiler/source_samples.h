// Samples of the sources of a dataset and their positions, read by GDAL without the engine.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace terrace::tiler {

// Degrees, and metres in the source's datum.
struct Sample {
  double longitude, latitude, height;
};

// All valid samples of a raster, with their positions on the globe.
std::vector<Sample> SamplesOf(const std::string& path);

// The samples at positions without a near sample of a raster: outside it, or in a void wider than those that are
// filled.
std::vector<Sample> Outside(const std::vector<Sample>& samples, const std::string& path);

// An index of samples by position.
class SampleIndex {
 public:
  explicit SampleIndex(std::vector<Sample> samples);

  const std::vector<Sample>& all() const { return samples_; }

  // Calls visit(sample) for the samples in a box in degrees, including its rim. Precondition: the box is between -180
  // and 180.
  template <typename Visit>
  void ForEach(double west, double south, double east, double north, const Visit& visit) const {
    for (std::size_t y = BinOf(south - south_, height_); y <= BinOf(north - south_, height_); ++y) {
      for (std::size_t x = BinOf(west - west_, width_); x <= BinOf(east - west_, width_); ++x) {
        for (std::size_t i = first_[y * kBins + x]; i < first_[y * kBins + x + 1]; ++i) {
          const Sample& sample = samples_[i];
          if (sample.longitude < west || sample.longitude > east) continue;
          if (sample.latitude < south || sample.latitude > north) continue;
          visit(sample);
        }
      }
    }
  }

 private:
  static constexpr std::size_t kBins = 512;
  static std::size_t BinOf(double at, double size);

  std::vector<Sample> samples_;  // by bin; those on the antimeridian once on each side of it
  std::vector<std::size_t> first_;
  double west_ = 180, south_ = 90, width_ = 0, height_ = 0;
};

}  // namespace terrace::tiler
