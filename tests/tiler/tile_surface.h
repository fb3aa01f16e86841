// Compares the surface in a tile's bytes with the samples of the sources, without the engine.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/tile_key.h"
#include "tests/proto/quantized_mesh_decoder.h"
#include "tests/tiler/source_samples.h"

namespace terrace::tiler {

// An index of the triangles of a tile by position. Precondition: the mesh outlives it.
class TileSurface {
 public:
  TileSurface(const proto::DecodedTile& mesh, const geo::TileKey& key);

  // The error of the surface at a sample in metres, the larger of two: of the height interpolated in longitude and
  // latitude, which clients sample, and of the flat triangles on the sample's plumb line, which they draw. Negative if
  // the sample is outside the tile.
  double ErrorAt(const Sample& sample) const;

  // The largest error of the samples in the tile; negative: there is none.
  double LargestError(const SampleIndex& samples) const;

 private:
  struct Triangle {
    std::array<std::size_t, 3> k{};  // counter-clockwise
    geo::Vec3 normal;                // of the flat triangle, as long as twice its area
    double longest = 0;              // of its sides, metres
    // Bounds in steps of u and v of all plumb lines that may meet the triangle.
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
