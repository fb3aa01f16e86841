// What a tile's bytes say of the ground, beside what the sources measured there: compared without the engine's help.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/tile_key.h"
#include "tests/proto/quantized_mesh_decoder.h"
#include "tests/tiler/source_samples.h"

namespace terrace::tiler {

// The triangles of a tile by where they are. Precondition: the mesh outlives it.
class TileSurface {
 public:
  TileSurface(const proto::DecodedTile& mesh, const geo::TileKey& key);

  // Metres that the surface is off at a sample, by what clients sample, the height interpolated in longitude and
  // latitude, and by what they draw, the flat triangles where the sample's plumb line meets them; negative where the
  // sample lies outside the tile.
  double ErrorAt(const Sample& sample) const;

  // Of samples in the tile; negative: there is none.
  double LargestError(const SampleIndex& samples) const;

 private:
  struct Triangle {
    std::array<std::size_t, 3> k{};  // counter-clockwise
    geo::Vec3 normal;                // of the flat triangle, as long as twice its area
    double longest = 0;              // of its sides, metres
    // Steps of u and v: of all plumb lines that may pass through it.
    double west = 0, south = 0, east = 0, north = 0;
  };

  int BinOf(double at) const;
  double HeightOf(std::size_t k) const;
  void FindExtent(Triangle& triangle) const;
  void AddTriangle(const std::array<std::uint32_t, 3>& corners);

  const proto::DecodedTile& mesh_;
  double west_, south_, side_;
  int bins_per_side_;
  std::vector<geo::Vec3> ecef_;
  std::vector<Triangle> triangles_;
  std::vector<std::vector<std::size_t>> bins_;
};

}  // namespace terrace::tiler
