#include "engine/gdal/sample_rules.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <string_view>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/ascii.h"
#include "engine/gdal/convert_samples.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/raster_file.h"

namespace terrace::dem {
namespace {

// Raw samples converted at a time. Limits the scratch memory of a read (8 MiB) and the reaction time to a stop.
constexpr int kSamplesPerRead = 1 << 20;
// Heights that are passed on at a time: 16 KiB.
constexpr int kHeightsPerVisit = 1 << 12;

// Many 16-bit elevation files contain SRTM's void value without declaring it; no place on Earth has this height.
std::optional<double> NodataOf(GDALRasterBand& band) {
  const std::optional<double> declared = DeclaredNodata(band);
  if (declared || band.GetRasterDataType() != GDT_Int16) return declared;
  return std::numeric_limits<std::int16_t>::min();
}

// The band that says which samples are valid: GDAL's mask, or an alpha band of a type that GDAL does not use as a mask.
// Null: all are valid.
GDALRasterBand* MaskOf(GDALRasterBand& band) {
  if (HasMaskBand(band)) return band.GetMaskBand();
  GDALDataset* const dataset = band.GetDataset();
  for (int i = 1; dataset != nullptr && i <= dataset->GetRasterCount(); ++i) {
    GDALRasterBand* const other = dataset->GetRasterBand(i);
    if (other != &band && other->GetColorInterpretation() == GCI_AlphaBand) return other;
  }
  return nullptr;
}

bool IsSignedByte(GDALRasterBand& band) {
  const char* const type = band.GetMetadataItem("PIXELTYPE", "IMAGE_STRUCTURE");
  return band.GetRasterDataType() == GDT_Byte && type != nullptr && EQUAL(type, "SIGNEDBYTE");
}

}  // namespace

std::string AttributeOfDepths(GDALRasterBand& band) {
  if (const char* const direction = band.GetMetadataItem("positive")) {
    return EQUAL(direction, "down") ? "positive: down" : "";
  }
  const char* const quantity = band.GetMetadataItem("standard_name");
  const std::string name = quantity == nullptr ? "" : quantity;
  return name == "depth" || name.find("depth_below_") != std::string::npos ? "standard_name: " + name : "";
}

std::optional<double> DeclaredNodata(GDALRasterBand& band) {
  int has = 0;
  double value = 0;
  switch (band.GetRasterDataType()) {
    case GDT_Int64:
      value = static_cast<double>(band.GetNoDataValueAsInt64(&has));
      break;
    case GDT_UInt64:
      value = static_cast<double>(band.GetNoDataValueAsUInt64(&has));
      break;
    default:
      value = band.GetNoDataValue(&has);
      break;
  }
  return has != 0 ? std::optional(value) : std::nullopt;
}

std::string WhyOverviewsLackMasks(GDALRasterBand& band) {
  constexpr const char* kRemedy =
      "; copy it with `gdal_translate --config GDAL_TIFF_INTERNAL_MASK YES in out` and make the copy's overviews";
  GDALRasterBand* const mask = MaskOf(band);
  if (mask == nullptr || band.GetOverviewCount() == 0) return {};
  // GDAL makes masks for such overviews, which hide nothing.
  if (HasFileEndingWith(*band.GetDataset(), ".msk") && mask->GetOverviewCount() == 0) {
    return std::string("the mask in a file of its own has no overviews") + kRemedy;
  }
  for (int i = 0; i < band.GetOverviewCount(); ++i) {
    GDALRasterBand* const overview = band.GetOverview(i);
    if (overview == nullptr) continue;
    GDALRasterBand* const of_overview = MaskOf(*overview);
    if (of_overview == nullptr || of_overview->GetXSize() != overview->GetXSize() ||
        of_overview->GetYSize() != overview->GetYSize()) {
      return std::string("they have no masks, as the raster has") + kRemedy;
    }
  }
  return {};
}

std::string WhyOverviewsHaveOtherNodata(GDALRasterBand& band) {
  const std::optional<double> declared = DeclaredNodata(band);
  const bool compare_as_float = band.GetRasterDataType() == GDT_Float32;
  const auto is_declared = [&](const std::optional<double>& stated) {
    if (!stated || !declared) return stated == declared;
    if (std::isnan(*stated) || std::isnan(*declared)) return std::isnan(*stated) && std::isnan(*declared);
    return *stated == *declared || (compare_as_float && static_cast<float>(*stated) == static_cast<float>(*declared));
  };
  for (int i = 0; i < band.GetOverviewCount(); ++i) {
    GDALRasterBand* const overview = band.GetOverview(i);
    if (overview == nullptr || is_declared(DeclaredNodata(*overview))) continue;
    return "they state another nodata value than the raster, or none, as if they were made before it stated its nodata "
           "value; make them anew with `gdaladdo -clean file` and `gdaladdo -r average file`";
  }
  return {};
}

std::optional<double> MetresPerUnit(const std::string& unit) {
  if (unit.empty()) return 1;
  std::string name;
  for (const char c : unit) {
    if (std::isdigit(static_cast<unsigned char>(c))) return std::nullopt;  // "0.1 m"
    if (std::isalpha(static_cast<unsigned char>(c))) name += ToLower(c);
  }
  constexpr double kFoot = 0.3048, kSurveyFoot = 1200.0 / 3937.0;
  struct Unit {
    double metres;
    std::string_view names;
  };
  constexpr Unit kUnits[] = {
      {1, " m metre metres meter meters "},
      {.01, " cm centimetre centimeter centimetres centimeters "},
      {.001, " mm millimetre millimeter millimetres millimeters "},
      {1000, " km kilometre kilometer kilometres kilometers "},
      {.1, " dm decimetre decimeter decimetres decimeters "},
      {kFoot, " ft foot feet internationalfoot "},
      {kSurveyFoot, " ussurveyfoot footussurvey ftus usft ussurveyfeet footus surveyfoot feetus usfeet usfoot "},
      {3 * kFoot, " yard yards "},
      {6 * kFoot, " fathom fathoms "},
  };
  for (const Unit& unit_of : kUnits) {
    if (!name.empty() && unit_of.names.find(" " + name + " ") != std::string_view::npos) return unit_of.metres;
  }
  return std::nullopt;
}

SampleRules SampleRules::Of(GDALRasterBand& band, const std::string& crs_unit) {
  SampleRules rules;
  rules.nodata = NodataOf(band);
  rules.compare_as_float = band.GetRasterDataType() == GDT_Float32;
  rules.has_mask = MaskOf(band) != nullptr;
  rules.is_signed_byte = IsSignedByte(band);
  rules.scale = band.GetScale();
  rules.offset = band.GetOffset();
  rules.unit = band.GetUnitType();
  if (rules.unit.empty()) rules.unit = crs_unit;
  rules.metres_per_unit = MetresPerUnit(rules.unit).value_or(1);
  return rules;
}

namespace {

// Most bands have at most one nodata value and no other rules.
bool IsPlain(const SampleRules& rules) { return !rules.has_mask && !rules.is_indicator && rules.extra_nodata.empty(); }

// Raw samples are heights in metres.
bool IsInMetres(const SampleRules& rules) {
  return rules.scale == 1 && rules.offset == 0 && rules.metres_per_unit == 1 && !rules.is_signed_byte;
}

// The type in which a band is read: its own if ConvertSamples does all that the rules require, else double.
GDALDataType RawTypeOf(GDALRasterBand& band, const SampleRules& rules) {
  const GDALDataType type = band.GetRasterDataType();
  const bool is_exact = type == GDT_Byte || type == GDT_Int16 || type == GDT_UInt16 || type == GDT_Float32;
  return is_exact && IsPlain(rules) && IsInMetres(rules) ? type : GDT_Float64;
}

// The largest float that is at most a number; the smallest float that is at least a number.
float FloatAtMost(double value) {
  const auto rounded = static_cast<float>(value);
  return rounded > value ? std::nextafter(rounded, -std::numeric_limits<float>::infinity()) : rounded;
}
float FloatAtLeast(double value) { return -FloatAtMost(-value); }

// For plain rules in metres and raw types that float represents exactly.
HeightLimits LimitsOf(const SampleRules& rules) {
  float nodata = std::numeric_limits<float>::quiet_NaN();  // equal to nothing
  if (rules.nodata) {
    const auto rounded = static_cast<float>(*rules.nodata);
    // Samples of Float32 bands may equal a nodata value that is stated with more digits than they have.
    if (rules.compare_as_float || static_cast<double>(rounded) == *rules.nodata) nodata = rounded;
  }
  return {nodata, FloatAtLeast(rules.lowest), FloatAtMost(rules.highest)};
}

// Equivalent to ToHeight for plain rules. `raw`: of RawTypeOf.
void ConvertPlain(const SampleRules& rules, GDALDataType type, const std::byte* raw, std::size_t count, float* out) {
  if (type != GDT_Float64) return ConvertSamples(type, raw, count, LimitsOf(rules), out);
  const auto* const values = reinterpret_cast<const double*>(raw);
  double nodata = rules.nodata.value_or(std::numeric_limits<double>::quiet_NaN());
  if (rules.compare_as_float) nodata = static_cast<float>(nodata);
  const double scale = rules.scale, offset = rules.offset, unit = rules.metres_per_unit;
  const double lowest = rules.lowest, highest = rules.highest;
  for (std::size_t i = 0; i < count; ++i) {
    const double height = (values[i] * scale + offset) * unit;
    const bool is_valid = (values[i] != nodata) & (height >= lowest) & (height <= highest);
    out[i] = is_valid ? static_cast<float>(height) : SampleRules::kVoid;
  }
}

// For rules without a margin of voids.
Result<void> VisitSamples(GDALRasterBand& band, const SampleRules& rules, int col, int row, int cols, int rows,
                          const AddRows& add, const std::stop_token& stop) {
  const int rows_at_once = std::clamp(kSamplesPerRead / cols, 1, rows);
  const int rows_per_visit = std::clamp(kHeightsPerVisit / cols, 1, rows);
  const std::size_t most = Area(cols, rows_at_once);
  const GDALDataType type = RawTypeOf(band, rules);
  const auto bytes_per_sample = static_cast<std::size_t>(GDALGetDataTypeSizeBytes(type));
  // Not initialized, because it is written before it is read, and filling it with zeros takes longer than the
  // conversion.
  const auto raw = std::make_unique_for_overwrite<std::byte[]>(most * bytes_per_sample);
  const auto heights = std::make_unique_for_overwrite<float[]>(Area(cols, rows_per_visit));
  std::vector<std::uint8_t> mask(rules.has_mask ? most : 0);
  for (int done = 0; done < rows; done += rows_at_once) {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "reading heights was stopped");
    const int count = std::min(rows_at_once, rows - done);
    bool is_read = ReadRaw(band, col, row + done, cols, count, type, raw.get());
    if (is_read && rules.has_mask) {
      GDALRasterBand* const valid = MaskOf(band);
      is_read = valid != nullptr && ReadRaw(*valid, col, row + done, cols, count, GDT_Byte, mask.data());
    }
    if (!is_read) {
      return MakeError(ErrorCode::kUnavailable, "rows {}..{} cannot be read ({})", row + done, row + done + count - 1,
                       TakeGdalError());
    }
    for (int r = 0; r < count; r += rows_per_visit) {
      const int visited = std::min(rows_per_visit, count - r);
      const std::size_t first = IndexAt(0, r, cols), samples = Area(cols, visited);
      std::byte* const values = raw.get() + first * bytes_per_sample;
      auto* const doubles = reinterpret_cast<double*>(values);  // where `type` is GDT_Float64
      if (rules.is_signed_byte) {
        for (std::size_t i = 0; i < samples; ++i) doubles[i] -= doubles[i] > 127 ? 256 : 0;
      }
      if (IsPlain(rules)) {
        ConvertPlain(rules, type, values, samples, heights.get());
      } else {
        for (std::size_t i = 0; i < samples; ++i) {
          const bool is_hidden = rules.has_mask && mask[first + i] == 0;
          heights[i] = !is_hidden ? rules.ToHeight(doubles[i]) : rules.is_indicator ? 0.0f : SampleRules::kVoid;
        }
      }
      add(heights.get(), visited);
    }
  }
  return {};
}

// Makes voids of the values within `reach` of a void, among `count` values that are `stride` apart.
void WidenVoids(float* first, int count, std::ptrdiff_t stride, int reach, std::vector<char>& near) {
  near.assign(static_cast<std::size_t>(count), 0);
  for (int i = 0; i < count; ++i) {
    if (!std::isnan(first[i * stride])) continue;
    std::fill(near.begin() + std::max(i - reach, 0), near.begin() + std::min(i + reach + 1, count), 1);
  }
  for (int i = 0; i < count; ++i) {
    if (near[static_cast<std::size_t>(i)] != 0) first[i * stride] = SampleRules::kVoid;
  }
}

}  // namespace

Result<void> ReadHeights(GDALRasterBand& band, const SampleRules& rules, int col, int row, int cols, int rows,
                         float* out, const std::stop_token& stop) {
  const auto copy = [&](const float* heights, std::int64_t count) { out = std::copy_n(heights, count * cols, out); };
  return VisitHeights(band, rules, col, row, cols, rows, copy, stop);
}

Result<void> VisitHeights(GDALRasterBand& band, const SampleRules& rules, int col, int row, int cols, int rows,
                          const AddRows& add, const std::stop_token& stop) {
  if (rules.void_margin == 0) return VisitSamples(band, rules, col, row, cols, rows, add, stop);
  // Extends the window by the reach of voids, so that a void does not depend on the window.
  const int left = std::max(col - rules.void_margin, 0), top = std::max(row - rules.void_margin, 0);
  const int wide = std::min(col + cols + rules.void_margin, band.GetXSize()) - left;
  const int high = std::min(row + rows + rules.void_margin, band.GetYSize()) - top;
  std::vector<float> around;
  around.reserve(Area(wide, high));
  const auto keep = [&](const float* heights, std::int64_t count) {
    around.insert(around.end(), heights, heights + count * wide);
  };
  if (auto read = VisitSamples(band, rules, left, top, wide, high, keep, stop); !read) return read;
  std::vector<char> near;
  for (int r = 0; r < high; ++r)
    WidenVoids(&around[static_cast<std::size_t>(r) * wide], wide, 1, rules.void_margin, near);
  for (int c = 0; c < wide; ++c) WidenVoids(&around[static_cast<std::size_t>(c)], high, wide, rules.void_margin, near);
  for (int r = 0; r < rows; ++r) add(around.data() + std::ptrdiff_t{row - top + r} * wide + (col - left), 1);
  return {};
}

}  // namespace terrace::dem
