// What a tile's bytes say of the ground, beside what the sources measured there: found, placed and compared without the
// engine's help.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/tile_key.h"
#include "tests/proto/quantized_mesh_decoder.h"

namespace terrace::server {

struct Sample {
  double longitude, latitude, height;
};

// All valid samples of a raster, by GDAL alone, with their places on the globe.
std::vector<Sample> SamplesOf(const std::string& path);

// The triangles of a tile by where they are. Precondition: the mesh outlives it.
class TileSurface {
 public:
  TileSurface(const proto::DecodedTile& mesh, const geo::TileKey& key);

  // Metres that the surface is off at a sample, by what clients sample and by what they draw; negative outside.
  double ErrorAt(const Sample& sample) const;
  double LargestError(const std::vector<Sample>& samples) const;

 private:
  static constexpr int kBins = 64;
  static int BinOf(double at);
  double HeightOf(std::size_t k) const;

  const proto::DecodedTile& mesh_;
  double west_, south_, side_;
  std::vector<geo::Vec3> ecef_;
  std::vector<std::vector<std::size_t>> bins_;
};

}  // namespace terrace::server
