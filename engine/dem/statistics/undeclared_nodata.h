// Voids that a file does not declare: nodata values left among the heights, values that resampling mixed from them at
// the edges of voids, and collars of zeros around the data.
//
// Real terrain must not be lost: every rule looks at the whole raster, and one sample that speaks against it is enough.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/gdal/sample_rules.h"

namespace terrace::dem {

struct Chunk;  // raster_chunk.h

// How the zeros of a raster meet other heights, counted while it is scanned.
struct ZeroEdges {
  std::int64_t high = 0, low = 0;  // pairs of neighbours, one zero and one farther from it than a step, or nearer
  std::int64_t zeros = 0, at_border = 0;  // all, and those in the outermost rows and columns
  // The ground, samples that are no zeros: the first and last columns and rows it lies in, and two of its heights that
  // differ, if there are.
  std::int32_t west = std::numeric_limits<std::int32_t>::max(), east = -1, north = west, south = -1;
  float lowest = std::numeric_limits<float>::infinity(), highest = -lowest;

  // Metres from a coast's last sea to its first land, at most: 100, and where samples lie far apart, a slope of one in
  // ten.
  static double CoastStep(double spacing_m) { return std::max(100.0, spacing_m / 10); }

  // Heights of a chunk of a raster of that size; `stride` values lie from one row to the next.
  void Add(const float* heights, std::ptrdiff_t stride, const Chunk& chunk, int raster_width, int raster_height,
           double step_m);
  void Add(const ZeroEdges& other);

  // Zeros that reach the border of a raster of that size, beside nearly all of which the ground is more than a step
  // off: no sea looks so. They lie in areas or along the border; those strewn over the raster are something else. What
  // they surround is no single height, and reaches to all four sides of the raster or nearly: a raster is no larger
  // than its data. A block or an island with cliffs on flat ground at 0 m does not.
  bool IsCollar(int raster_width, int raster_height) const;

 private:
  // Of one row, which begins at that column.
  void AddGround(const float* heights, int cols, int raster_col, int raster_row);
};

struct DetectedNodata {
  std::vector<double> values;                               // raw values
  double lowest = -kMaxAbsHeight, highest = kMaxAbsHeight;  // metres
  int rim = 0;                                              // samples, of SampleRules
  std::string text;                                         // for people

  bool any() const { return !text.empty(); }
  void AddTo(SampleRules& rules) const;
};

// Whether heights in this range, beside `voids` declared ones, may hide undeclared ones: else FindVoids need not look.
// `has_collar`: ZeroEdges::IsCollar.
bool MayHideVoids(const SampleRules& rules, double lowest, double highest, bool has_voids, bool has_collar);

// Reads the whole band twice more. `coast_step_m`: ZeroEdges::CoastStep of its spacing.
//
// - -32768, -32767, -9999, 9999, 32767 and 65535 are nodata values if they stand alone: at most a quarter as many
// samples
//   lie within 1,000 m of the value as are equal to it.
// - Heights below -500 m or above 9,000 m are mixtures of heights and a nodata value if all of them lie within 3
// samples
//   of a void, though at most a quarter of all samples do, and at least half of them differ from a neighbour by more
//   than 1,000 m (or the coast step). No land is lower or higher, and none is so steep. A sea floor has such heights
//   elsewhere too; there the bound is -12,000 m. If they are an eighth of the samples near voids or more, as after
//   resampling, all voids grow by 2 samples.
// - Zeros are voids where they are a collar; voids then grow by one sample, if at most a quarter of all lie near voids.
//
// So scattered voids, and voids between sparse data, take no sample beside them away.
Result<DetectedNodata> FindVoids(GDALRasterBand& band, const SampleRules& rules, bool has_collar, double coast_step_m,
                                 const std::stop_token& stop = {});

}  // namespace terrace::dem
