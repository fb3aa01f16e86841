#include "engine/sources/sample_messages.h"

#include <fmt/format.h>

#include <cmath>

#include "engine/core/plain_number.h"

namespace terrace::dem {

Result<void> CheckScale(const SampleRules& rules, const std::string& path) {
  if (std::isfinite(rules.scale) && rules.scale != 0) return {};
  return MakeError(
      ErrorCode::kInvalidArgument,
      "{}: states a scale of {}, by which no sample has a height; correct it with `gdal_translate -a_scale "
      "1 -a_offset 0 in out`",
      path, rules.scale);
}

std::string DoubtsOf(const HeightRange& heights) {
  constexpr double kHighest = 9000, kDeepest = -11500;
  if (heights.max <= kHighest && heights.min >= kDeepest) return "";
  return fmt::format(
      "heights from {} to {} m are hardly metres (Earth has -10,935 to 8,849), and those beyond {} count as "
      "voids: state the metres a unit has with `gdal_translate -a_scale FACTOR in out`, 0.01 for centimetres",
      PlainNumber(heights.min), PlainNumber(heights.max), PlainNumber(kMaxAbsHeight));
}

std::string DescribeLackOfHeights(const SampleRules& rules, const std::string& path) {
  return fmt::format(
      "{}: has no valid sample, only voids; check its nodata value with gdalinfo and correct it with "
      "`gdal_translate -a_nodata VALUE in out`; heights beyond {} m are voids too: those in another unit "
      "need `-a_scale FACTOR`, the metres of one{}{}",
      path, PlainNumber(kMaxAbsHeight),
      MetresPerUnit(rules.unit)
          ? ""
          : fmt::format("; the file's unit \"{}\" is not known, and counts as metres", rules.unit),
      rules.extra_nodata.empty() && rules.void_margin <= 0
          ? ""
          : "; heights that the file does not declare to be voids were taken for such: with --nodata declared (in a "
            "configuration \"nodata\": \"declared\") they are not");
}

}  // namespace terrace::dem
