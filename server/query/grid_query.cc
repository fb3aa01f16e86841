#include "server/query/grid_query.h"

#include <array>
#include <iterator>
#include <string>
#include <utility>

#include "server/http/text.h"
#include "server/query/drawn_parameters.h"

namespace terrace::server {
namespace {

constexpr const char* kGridNames[] = {"bbox",  "width",   "height", "spacing", "crs",      "format", "datum",
                                      "range", "surface", "level",  "error",   "fraction", "atleast"};
enum GridName {
  kGridBbox,
  kGridWidth,
  kGridHeight,
  kGridSpacing,
  kGridCrs,
  kGridFormat,
  kGridDatum,
  kGridRange,
  kGridSurface,
  kGridLevel,
  kGridError,
  kGridFraction,
  kGridAtLeast,
  kGridNameCount
};
static_assert(std::size(kGridNames) == kGridNameCount);
using GridTexts = std::array<std::optional<std::string>, kGridNameCount>;

tl::unexpected<Error> InvalidGrid(std::string message) {
  return tl::unexpected(Error{ErrorCode::kInvalidArgument, std::move(message)});
}

Result<GridTexts> GridTextsOf(std::string_view query) {
  GridTexts texts;
  const Result<void> read = ReadParameters(
      query, kGridNames,
      [&](std::size_t i, const std::string& value) -> Result<void> {
        texts[i] = value;
        return {};
      },
      "bbox, width, height, spacing, crs, format, datum, range, surface, and with surface=served level, error, "
      "fraction, atleast");
  if (!read) return tl::unexpected(read.error());
  return texts;
}

Result<void> SetSize(const GridTexts& texts, dem::GridRequest& grid) {
  if (texts[kGridSpacing]) {
    if (texts[kGridWidth] || texts[kGridHeight]) return InvalidGrid("spacing excludes width and height");
    grid.spacing = PositiveNumber(*texts[kGridSpacing]);
    return grid.spacing ? Result<void>() : InvalidGrid("spacing must be a finite number above 0, in units of the crs");
  }
  if (!texts[kGridWidth] || !texts[kGridHeight]) return InvalidGrid("width and height, or spacing, are needed");
  for (const auto& [name, of] : {std::pair(kGridWidth, &grid.columns), std::pair(kGridHeight, &grid.rows)}) {
    *of = PlainDecimal(*texts[name], /*max_digits=*/15);
    if (!*of) return InvalidGrid(fmt::format("{} must be a whole number from 2", kGridNames[name]));
  }
  return {};
}

Result<void> SetCrs(const std::optional<std::string>& text, dem::GridRequest& grid) {
  if (!text) return {};
  std::string_view code = *text;
  const bool is_epsg = code.size() > 5 && EqualsIgnoringCase(code.substr(0, 5), "EPSG:");
  const auto number = is_epsg ? PlainDecimal(code.substr(5), /*max_digits=*/6) : std::nullopt;
  if (!number) return InvalidGrid("crs must be EPSG: and a number of at most six digits, such as EPSG:32611");
  grid.epsg = static_cast<int>(*number);
  return {};
}

Result<void> SetGridFormat(const std::optional<std::string>& text, GridFormat& format) {
  if (!text) return {};
  return SetOneOf(format, "format", *text,
                  {{"f32", GridFormat::kF32},
                   {"r16", GridFormat::kR16},
                   {"geotiff", GridFormat::kGeoTiff},
                   {"png16", GridFormat::kPng16},
                   {"json", GridFormat::kJson}});
}

Result<void> SetRange(const std::optional<std::string>& text, GridQuery& query) {
  if (!text) return {};
  const auto numbers = NumbersOf<2>(*text);
  constexpr double kMaxScale = 1e6;  // the scale of larger ones may overflow
  if (!numbers || (*numbers)[0] >= (*numbers)[1] || (*numbers)[0] < -kMaxScale || (*numbers)[1] > kMaxScale) {
    return InvalidGrid("range must be two numbers of metres from -1000000 to 1000000, the lower first");
  }
  if (!HasIntegers(query.format)) return InvalidGrid("range needs format=r16, png16 or json");
  query.range = dem::HeightRange{(*numbers)[0], (*numbers)[1]};
  return {};
}

}  // namespace

Result<GridQuery> ParseGrid(std::string_view text) {
  const Result<GridTexts> parsed = GridTextsOf(text);
  if (!parsed) return tl::unexpected(parsed.error());
  const GridTexts& texts = *parsed;
  GridQuery query;
  const auto box = texts[kGridBbox] ? NumbersOf<4>(*texts[kGridBbox]) : std::nullopt;
  if (!box) return InvalidGrid("bbox=west,south,east,north is needed: four numbers in units of the crs");
  query.grid.west = (*box)[0], query.grid.south = (*box)[1], query.grid.east = (*box)[2], query.grid.north = (*box)[3];
  for (const Result<void>& set :
       {SetSize(texts, query.grid), SetCrs(texts[kGridCrs], query.grid),
        SetGridFormat(texts[kGridFormat], query.format), SetRange(texts[kGridRange], query)}) {
    if (!set) return tl::unexpected(set.error());
  }
  if (texts[kGridDatum]) {
    if (const Result<void> set = SetDatum(query.datum, *texts[kGridDatum]); !set) return tl::unexpected(set.error());
  }
  Result<std::optional<tiler::DrawnSurface>> drawn =
      ParseDrawn({texts[kGridSurface], texts[kGridLevel], texts[kGridError], texts[kGridFraction], texts[kGridAtLeast],
                  std::nullopt, std::nullopt});
  if (!drawn) return tl::unexpected(drawn.error());
  query.drawn = *std::move(drawn);
  query.names_source = texts[kGridSurface].has_value() && !query.drawn;
  if (query.drawn && query.datum != dem::HeightDatum::kEllipsoid) {
    return InvalidGrid("surface=served has ellipsoidal heights alone, as tiles have");
  }
  return query;
}

}  // namespace terrace::server
