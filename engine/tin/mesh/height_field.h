// A rectangular grid of height samples: the input of the mesher.
//
// Coordinates: x is the column, y the row; a sample is (x, y) with 0 <= x < width, 0 <= y < height, stored row by row.
// Counter-clockwise means counter-clockwise in these axes. The caller decides where row 0 is: in tiles it is in the
// SOUTH, in rasters read from files in the NORTH.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/result.h"
#include "engine/tin/mesh/tin_mesh.h"

namespace terrace::tin {

class HeightField {
 public:
  // Coordinates stay below 2^15, which keeps the in-circle test inside 64 bits (triangulation.h).
  static constexpr int kMaxSide = 1 << 15;

  // `heights` has width * height values in metres, row by row. The vector is not copied if height >= 8 and its capacity
  // is at least its size plus 32 * height; otherwise it may be. NaN and infinities are voids. Voids do not
  // contribute to errors, and no vertex has the height of a void. Refuses fields with a side below 2 or above kMaxSide,
  // with a wrong number of values, or without a valid sample.
  static Result<HeightField> Make(int width, int height, std::vector<float> heights);

  int width() const { return width_; }
  int height() const { return height_; }
  bool has_voids() const { return has_voids_; }

  // NaN at a void.
  float At(int x, int y) const { return Row(y)[x]; }
  float At(SamplePosition sample) const { return At(sample.x, sample.y); }
  const float* Row(int y) const { return heights_.data() + static_cast<std::size_t>(y) * stride_; }

  // Distance between rows, in samples. Loads of 16 samples that begin in any row but the last stay inside the memory.
  // In fields with fewer than 16 columns or 8 rows they may also begin in the last row, and in up to eight rows after
  // it: there is padding of arbitrary values.
  int stride() const { return static_cast<int>(stride_); }

  // A power of two, in metres; all heights are multiples of it. 0 if none is known. Sums of heights and their products
  // with integers are exact in single precision while they stay below 2^24 quanta.
  float quantum() const { return quantum_; }

  // The largest doubled area of triangles that scans may process in integers: its product with the distance of a sample
  // from the triangle's plane is below 2^31 quanta, and differences of heights are below 2^22. 0 if scans cannot use
  // integers or have no need to.
  float max_integer_area() const { return max_integer_area_; }

  // The height of a vertex at (x, y): its sample, or the nearest valid sample if its sample is void. Only corners and
  // seeds can be void. Ties go to the smaller row, then column.
  float VertexHeight(int x, int y) const {
    const float own = At(x, y);
    return std::isnan(own) ? NearestHeight(x, y) : own;
  }

 private:
  // Squares of 64 x 64 samples, so that the search for a valid one crosses wide voids in large steps.
  static constexpr int kPatchSide = 64;

  struct Nearest {
    std::int64_t squared_distance;
    int x, y;
  };

  HeightField(int width, int height, std::vector<float> heights, bool has_voids, double relief_m);

  void LayOut();
  float NearestHeight(int x, int y) const;
  void SearchPatch(int column, int row, int x, int y, Nearest& nearest) const;

  int width_ = 0;
  int height_ = 0;
  bool has_voids_ = false;
  float quantum_ = 0;
  float max_integer_area_ = 0;
  std::size_t stride_ = 0;
  std::vector<float> heights_;
  int patches_along_x_ = 0, patches_along_y_ = 0;
  std::vector<bool> has_height_;  // by patch, row by row; empty if there are no voids
};

}  // namespace terrace::tin
