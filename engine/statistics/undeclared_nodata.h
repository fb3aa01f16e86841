// Detects voids that a file does not declare: undeclared nodata values, values that resampling mixed from heights and
// nodata values at the edges of voids, and collars of zeros around the data. Real terrain must not be lost: every rule
// examines the whole raster, and applies only if few samples or none contradict it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/gdal/sample_rules.h"

namespace terrace::dem {

struct Chunk;  // raster_chunk.h

// Counts of the zeros of a raster and of their neighbours.
struct ZeroEdges {
  // Pairs of a zero and a nonzero neighbour that differ by more than the step, and by less.
  std::int64_t steep = 0, gentle = 0;
  std::int64_t zeros = 0, at_border = 0;  // all zeros; zeros in the outermost rows and columns
  // The ground, which is all nonzero samples: its first and last columns and rows, and two different heights of it if
  // there are any.
  std::int32_t west = std::numeric_limits<std::int32_t>::max(), east = -1, north = west, south = -1;
  float lowest = std::numeric_limits<float>::infinity(), highest = -lowest;

  // The largest height step of a coast in metres, from the last sample of sea to the first of land: 100, or a slope of
  // one in ten if samples are far apart.
  static double CoastStep(double spacing_m) { return std::max(100.0, spacing_m / 10); }

  // Adds the heights of a chunk of a raster. `stride`: number of values from one row to the next.
  void Add(const float* heights, std::ptrdiff_t stride, const Chunk& chunk, int raster_width, int raster_height,
           double step_m);
  void Add(const ZeroEdges& other);

  // Whether the zeros are a collar of a raster of this size. All of these must hold: zeros reach the border; nearly all
  // differences to neighbouring ground exceed the step, which excludes a sea; zeros form areas or lie along the border,
  // and are not scattered; the ground has more than one height, and reaches all four sides or nearly, because a raster
  // is no larger than its data. A block or an island with cliffs on flat ground at 0 m is not a collar.
  bool IsCollar(int raster_width, int raster_height) const;

 private:
  // Adds one row that begins at the given column.
  void AddGround(const float* heights, int cols, int raster_col, int raster_row);
};

struct DetectedNodata {
  std::vector<double> values;                               // raw values
  double lowest = -kMaxAbsHeight, highest = kMaxAbsHeight;  // metres
  int void_margin = 0;                                      // of SampleRules
  std::string text;                                         // for people

  bool any() const { return !text.empty(); }
  void AddTo(SampleRules& rules) const;
};

// Whether a raster with this range of heights may have undeclared voids; if not, FindVoids need not be called.
// `has_voids`: the raster has declared voids. `has_collar`: ZeroEdges::IsCollar.
bool MayHideVoids(const SampleRules& rules, double lowest, double highest, bool has_voids, bool has_collar);

// Reads the whole band twice more. `coast_step_m`: ZeroEdges::CoastStep of its spacing.
//
// - -32768, -32767, -9999, 9999, 32767 and 65535 are nodata values if they stand alone: the samples within 1,000 m
//   of the value are at most a quarter as many as those equal to it.
// - Heights below -500 m or above 9,000 m are mixtures of heights and a nodata value if all of them lie within 3
//   samples of a void, though at most a quarter of all samples do, and at least half of them differ from a neighbour by
//   more than 1,000 m (or the coast step). No land is lower or higher, and none is so steep. Where heights below -500 m
//   also lie away from voids, as on a sea floor, the lower bound is -12,000 m. If mixtures are an eighth of the samples
//   near voids or more, as after resampling, all voids grow by 2 samples.
// - Zeros are voids if they are a collar; voids then grow by one sample, if at most a quarter of all samples are near
//   voids.
//
// Because of the limits of a quarter, samples beside scattered voids and sparse data between voids remain heights.
Result<DetectedNodata> FindVoids(GDALRasterBand& band, const SampleRules& rules, bool has_collar, double coast_step_m,
                                 const std::stop_token& stop = {});

}  // namespace terrace::dem
