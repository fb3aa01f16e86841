// A rectangular grid of height samples: what the mesher approximates.
//
// Coordinates: x is the column, y the row; a sample is (x, y) with 0 <= x < width, 0 <= y < height, stored row by row.
// Counter-clockwise means counter-clockwise in these axes. Whether row 0 lies in the north or in the south is the
// caller's business: tiles put row 0 in the SOUTH, rasters read from files put it in the NORTH.
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
  // Coordinates stay below 2^15, which keeps the in-circle predicate inside 64 bits (predicates.h).
  static constexpr int kMaxSide = 1 << 15;

  // `heights` has width * height values in metres, row by row; with a capacity of 32 more a row they are not copied,
  // unless there are fewer than 8 rows. NaN, infinities and whatever the caller turned into NaN are voids: they count
  // in no error and lend their value to no vertex. Refuses fields smaller than 2 x 2, larger than kMaxSide a side, with
  // a wrong number of values, or without a single valid sample.
  static Result<HeightField> Make(int width, int height, std::vector<float> heights);

  int width() const { return width_; }
  int height() const { return height_; }
  bool has_voids() const { return has_voids_; }

  // NaN at a void.
  float At(int x, int y) const { return Row(y)[x]; }
  float At(SamplePosition sample) const { return At(sample.x, sample.y); }
  const float* Row(int y) const { return heights_.data() + static_cast<std::size_t>(y) * stride_; }

  // Samples from one row to the next. Scans load whole vectors: 16 samples may be read from any sample that is not in
  // the first or last row, and from fields below 16 x 8 eight rows more than there are. What lies beyond is any value.
  int stride() const { return static_cast<int>(stride_); }

  // A power of two that all heights are multiples of, metres; 0 if none is known. Sums of heights, and products by
  // integers, are exact in single precision as long as they stay below 2^24 of it.
  float quantum() const { return quantum_; }

  // Doubled areas of triangles up to this one, times how far a sample inside is from the plane of three samples, are
  // below 2^31 quanta, and differences of heights below 2^22: scans may count in integers. 0 if they may not, or need
  // not.
  float most_area_in_integers() const { return most_area_in_integers_; }

  // The height a vertex at (x, y) gets: the sample, or where that is void (only corners and seeds can be) the height of
  // the nearest valid sample, ties to the smaller row, then column.
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
  float most_area_in_integers_ = 0;
  std::size_t stride_ = 0;
  std::vector<float> heights_;  // NaN between rows
  int patches_along_x_ = 0, patches_along_y_ = 0;
  std::vector<bool> has_height_;  // by patch, row by row; empty where there are no voids
};

}  // namespace terrace::tin
