#include "server/handlers/tile_heights.h"

#include <algorithm>
#include <cmath>

#include "engine/geo/error_ladder.h"
#include "proto/mesh/skirt.h"
#include "server/api/negotiate.h"

namespace terrace::server {
namespace {

dem::HeightRange RangeOf(const DatasetView& dataset, const geo::TileKey& key) {
  if (dataset.range_bound) return dataset.range_bound(key);
  return {std::min(dataset.min_height_m, dataset.floor_m), std::max(dataset.max_height_m, dataset.floor_m)};
}

double SkirtDepth(const DatasetView& dataset, const RequestedError& requested, int level) {
  const bool is_deepest = level == dataset.max_level();
  const int step = ErrorStep(requested, level, is_deepest, dataset.error_fraction);
  return proto::SkirtDepth(level, proto::SkirtError(level, step, is_deepest, dataset.error_fraction));
}

}  // namespace

proto::HeightSpan HeightsOfTile(const DatasetView& dataset, const RequestedError& requested, const geo::TileKey& key) {
  const bool is_deepest = key.level == dataset.max_level();
  const int step = ErrorStep(requested, key.level, is_deepest, dataset.error_fraction);
  const double error_m = geo::LadderError(key.level, step, dataset.error_fraction);
  // Skirts are shorter on each deeper level, except on the deepest level at a small `fraction`.
  const double skirt_m =
      std::max(SkirtDepth(dataset, requested, key.level), SkirtDepth(dataset, requested, dataset.max_level()));
  // Positions are rounded to a grid of at most a 32nd of the error; the lower rims of skirts are rounded twice.
  const double rounding_m = error_m / 32;
  const dem::HeightRange range = RangeOf(dataset, key);
  constexpr int kFinestStep = -6;
  const double unit_m = std::ldexp(1, std::max(std::ilogb(error_m / 4), kFinestStep));
  return {std::floor((range.min - skirt_m - 2 * rounding_m) / unit_m) * unit_m,
          std::ceil((range.max + rounding_m) / unit_m) * unit_m};
}

}  // namespace terrace::server
