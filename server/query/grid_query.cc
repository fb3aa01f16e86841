#include "server/query/grid_query.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <string>
#include <utility>

#include "server/http/text.h"
#include "server/query/drawn_parameters.h"

namespace terrace::server {
namespace {

constexpr const char* kNames[] = {"bbox",  "width",   "height", "spacing", "crs",      "format", "datum",
                                  "range", "surface", "level",  "error",   "fraction", "atleast"};
enum Name {
  kBbox,
  kWidth,
  kHeight,
  kSpacing,
  kCrs,
  kFormat,
  kDatum,
  kRange,
  kSurface,
  kLevel,
  kError,
  kFraction,
  kAtLeast,
  kNameCount
};
static_assert(std::size(kNames) == kNameCount);
using Texts = std::array<std::optional<std::string>, kNameCount>;

tl::unexpected<Error> Invalid(std::string message) {
  return tl::unexpected(Error{ErrorCode::kInvalidArgument, std::move(message)});
}

// Finite numbers with commas between them; nothing if the text is anything else.
template <std::size_t kCount>
std::optional<std::array<double, kCount>> NumbersOf(std::string_view text) {
  std::array<double, kCount> numbers{};
  for (std::size_t i = 0; i < kCount; ++i) {
    const std::size_t comma = i + 1 == kCount ? text.size() : text.find(',');
    const auto number = comma == std::string_view::npos ? std::nullopt : FiniteNumber(text.substr(0, comma));
    if (!number) return std::nullopt;
    numbers[i] = *number;
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return numbers;
}

Result<Texts> TextsOf(std::string_view query) {
  const Result<QueryParameters> sent = ParseQuery(query);
  if (!sent) return tl::unexpected(sent.error());
  Texts texts;
  for (const auto& [name, value] : *sent) {
    if (name == "v") continue;
    const auto known = std::find(std::begin(kNames), std::end(kNames), name);
    if (known == std::end(kNames)) {
      return Invalid(
          "unknown parameter; known are bbox, width, height, spacing, crs, format, datum, range, surface, and with "
          "surface=served level, error, fraction, atleast");
    }
    auto& text = texts[static_cast<std::size_t>(known - std::begin(kNames))];
    if (text) return Invalid(fmt::format("{} is given more than once", *known));
    text = value;
  }
  return texts;
}

Result<void> SetSize(const Texts& texts, dem::GridRequest& grid) {
  if (texts[kSpacing]) {
    if (texts[kWidth] || texts[kHeight]) return Invalid("spacing excludes width and height");
    grid.spacing = PositiveNumber(*texts[kSpacing]);
    return grid.spacing ? Result<void>() : Invalid("spacing must be a finite number above 0, in units of the crs");
  }
  if (!texts[kWidth] || !texts[kHeight]) return Invalid("width and height, or spacing, are needed");
  for (const auto& [name, of] : {std::pair(kWidth, &grid.columns), std::pair(kHeight, &grid.rows)}) {
    *of = PlainDecimal(*texts[name], /*max_digits=*/15);
    if (!*of) return Invalid(fmt::format("{} must be a whole number from 2", kNames[name]));
  }
  return {};
}

Result<void> SetCrs(const std::optional<std::string>& text, dem::GridRequest& grid) {
  if (!text) return {};
  std::string_view code = *text;
  const bool is_epsg = code.size() > 5 && EqualsIgnoringCase(code.substr(0, 5), "EPSG:");
  const auto number = is_epsg ? PlainDecimal(code.substr(5), /*max_digits=*/6) : std::nullopt;
  if (!number) return Invalid("crs must be EPSG: and a number, such as EPSG:32611");
  grid.epsg = static_cast<int>(*number);
  return {};
}

Result<void> SetFormat(const std::optional<std::string>& text, GridFormat& format) {
  constexpr std::pair<std::string_view, GridFormat> kFormats[] = {{"f32", GridFormat::kF32},
                                                                  {"r16", GridFormat::kR16},
                                                                  {"geotiff", GridFormat::kGeoTiff},
                                                                  {"png16", GridFormat::kPng16},
                                                                  {"json", GridFormat::kJson}};
  if (!text) return {};
  for (const auto& [name, value] : kFormats) {
    if (*text != name) continue;
    format = value;
    return {};
  }
  return Invalid("format must be f32, r16, geotiff, png16 or json");
}

Result<void> SetRange(const std::optional<std::string>& text, GridQuery& query) {
  if (!text) return {};
  const auto numbers = NumbersOf<2>(*text);
  if (!numbers || (*numbers)[0] >= (*numbers)[1])
    return Invalid("range must be two numbers of metres, the lower first");
  if (query.format == GridFormat::kF32 || query.format == GridFormat::kGeoTiff) {
    return Invalid("range needs format=r16 or png16");
  }
  query.range = dem::HeightRange{(*numbers)[0], (*numbers)[1]};
  return {};
}

}  // namespace

Result<GridQuery> ParseGrid(std::string_view text) {
  const Result<Texts> parsed = TextsOf(text);
  if (!parsed) return tl::unexpected(parsed.error());
  const Texts& texts = *parsed;
  GridQuery query;
  const auto box = texts[kBbox] ? NumbersOf<4>(*texts[kBbox]) : std::nullopt;
  if (!box) return Invalid("bbox=west,south,east,north is needed: four numbers in units of the crs");
  query.grid.west = (*box)[0], query.grid.south = (*box)[1], query.grid.east = (*box)[2], query.grid.north = (*box)[3];
  for (const Result<void>& set : {SetSize(texts, query.grid), SetCrs(texts[kCrs], query.grid),
                                  SetFormat(texts[kFormat], query.format), SetRange(texts[kRange], query)}) {
    if (!set) return tl::unexpected(set.error());
  }
  if (texts[kDatum] && *texts[kDatum] != "ellipsoid" && *texts[kDatum] != "orthometric") {
    return Invalid("datum must be ellipsoid or orthometric");
  }
  if (texts[kDatum] && *texts[kDatum] == "orthometric") query.datum = dem::HeightDatum::kOrthometric;
  Result<std::optional<tiler::DrawnSurface>> drawn = ParseDrawn(
      {texts[kSurface], texts[kLevel], texts[kError], texts[kFraction], texts[kAtLeast], std::nullopt, std::nullopt});
  if (!drawn) return tl::unexpected(drawn.error());
  query.drawn = *std::move(drawn);
  if (query.drawn && query.datum != dem::HeightDatum::kEllipsoid) {
    return Invalid("surface=served has ellipsoidal heights alone, as tiles have");
  }
  return query;
}

}  // namespace terrace::server
