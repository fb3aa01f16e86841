// The meaning of a raster band's raw values: which are voids, and how the others are converted to metres.
#pragma once

#include <gdal_priv.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

// Larger magnitudes are undeclared nodata values (1.7e38, -99999), not heights on Earth.
inline constexpr double kMaxAbsHeight = 99998.0;

struct SampleRules {
  std::optional<double> nodata;  // in raw values
  // For Float32 bands, whose nodata value may be stated with more digits than samples have.
  bool compare_as_float = false;
  std::vector<double> extra_nodata;                         // further raw values that are voids: configured or detected
  double lowest = -kMaxAbsHeight, highest = kMaxAbsHeight;  // metres; heights beyond are voids
  // Samples within this number of columns and rows of a void are voids too, because resampling mixed them with nodata
  // values. Applies only at full resolution.
  int void_margin = 0;
  bool has_mask = false;         // a mask band says which samples are valid
  bool is_signed_byte = false;   // bytes above 127 are negative numbers; GDAL before 3.7 does not convert them
  bool is_indicator = false;     // valid nonzero samples become 1, all others 0
  double scale = 1, offset = 0;  // raw * scale + offset is in the band's unit
  double metres_per_unit = 1;
  std::string unit;  // as stated; empty: none

  // `crs_unit`: the unit of the CRS's vertical axis, used where the band states none.
  static SampleRules Of(GDALRasterBand& band, const std::string& crs_unit);

  bool IsNodata(double raw) const {
    if (nodata && IsSame(raw, *nodata)) return true;
    return !extra_nodata.empty() && std::ranges::any_of(extra_nodata, [&](double value) { return IsSame(raw, value); });
  }
  bool IsSame(double raw, double value) const {
    return raw == value || (compare_as_float && static_cast<float>(raw) == static_cast<float>(value));
  }

  // Returns metres, or NaN for a void; 0 or 1 if is_indicator.
  float ToHeight(double raw) const {
    if (is_indicator) return raw != 0 && !std::isnan(raw) && !IsNodata(raw) ? 1.0f : 0.0f;
    if (IsNodata(raw)) return kVoid;
    const double height = Metres(raw);
    return height >= lowest && height <= highest ? static_cast<float>(height) : kVoid;
  }

  double Metres(double raw) const { return (raw * scale + offset) * metres_per_unit; }

  static constexpr float kVoid = __builtin_nanf("");
};

// The nodata value that a band states; nothing if it states none.
std::optional<double> DeclaredNodata(GDALRasterBand& band);

// The attribute of a netCDF variable that states that its samples count downwards, such as `positive: down` or
// `standard_name: sea_floor_depth_below_geoid` (CF conventions 1.11, section 3.3); empty: none does.
std::string AttributeOfDepths(GDALRasterBand& band);

// Returns why samples that the mask or the alpha band of a band hides are visible in its overviews, with the remedy.
// Empty: they are hidden there too, or nothing is hidden.
std::string WhyOverviewsLackMasks(GDALRasterBand& band);

// Returns why samples that the nodata value of a band hides are in its overviews, with the remedy: an overview states
// another value, or none. Empty: all state that of the band.
std::string WhyOverviewsHaveOtherNodata(GDALRasterBand& band);

// Returns metres per unit for a unit name, 1 for an empty one; nothing if the name is unknown.
std::optional<double> MetresPerUnit(const std::string& unit);

// Gets the next rows of heights.
using AddRows = std::function<void(const float* heights, std::int64_t rows)>;

// Reads the heights of a pixel window of a band or of one of its overviews; voids are NaN. Calls `add` with a few rows
// at a time, so that they are still in the processor's cache. kUnavailable: the band cannot be read. kCancelled:
// stopped.
Result<void> VisitHeights(GDALRasterBand& band, const SampleRules& rules, int col, int row, int cols, int rows,
                          const AddRows& add, const std::stop_token& stop);

// The same, row by row into `out`.
Result<void> ReadHeights(GDALRasterBand& band, const SampleRules& rules, int col, int row, int cols, int rows,
                         float* out, const std::stop_token& stop);

}  // namespace terrace::dem
