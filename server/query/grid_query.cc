#include "server/query/grid_query.h"

#include <string>
#include <utility>

#include "server/http/text.h"
#include "server/query/drawn_parameters.h"

namespace terrace::server {
namespace {

constexpr const char* kGridNames[] = {"bbox",  "width",   "height", "spacing", "crs",      "format", "datum",
                                      "range", "surface", "level",  "error",   "fraction", "atleast"};

tl::unexpected<Error> InvalidGrid(std::string message) {
  return tl::unexpected(Error{ErrorCode::kInvalidArgument, std::move(message)});
}

Result<SentTexts> GridTextsOf(std::string_view query) {
  SentTexts texts;
  const Result<void> read = ReadParameters(
      query, kGridNames,
      [&](std::size_t i, const std::string& value) -> Result<void> {
        texts.emplace(kGridNames[i], value);
        return {};
      },
      "bbox, width, height, spacing, crs, format, datum, range, surface, and with surface=served level, error, "
      "fraction, atleast");
  if (!read) return tl::unexpected(read.error());
  return texts;
}

Result<void> SetSize(const SentTexts& texts, dem::GridRequest& grid) {
  if (const std::string* const spacing = TextOf(texts, "spacing")) {
    if (texts.contains("width") || texts.contains("height")) return InvalidGrid("spacing excludes width and height");
    grid.spacing = PositiveNumber(*spacing);
    return grid.spacing ? Result<void>() : InvalidGrid("spacing must be a finite number above 0, in units of the crs");
  }
  if (!texts.contains("width") || !texts.contains("height")) {
    return InvalidGrid("width and height, or spacing, are needed");
  }
  for (const auto& [name, of] : {std::pair("width", &grid.columns), std::pair("height", &grid.rows)}) {
    *of = PlainDecimal(texts.at(name), /*max_digits=*/15);
    if (!*of) return InvalidGrid(fmt::format("{} must be a whole number from 2", name));
  }
  return {};
}

Result<void> SetCrs(const std::string* text, dem::GridRequest& grid) {
  if (text == nullptr) return {};
  std::string_view code = *text;
  const bool is_epsg = code.size() > 5 && EqualsIgnoringCase(code.substr(0, 5), "EPSG:");
  const auto number = is_epsg ? PlainDecimal(code.substr(5), /*max_digits=*/6) : std::nullopt;
  if (!number) return InvalidGrid("crs must be EPSG: and a number of at most six digits, such as EPSG:32611");
  grid.epsg = static_cast<int>(*number);
  return {};
}

Result<void> SetGridFormat(const std::string* text, GridFormat& format) {
  if (text == nullptr) return {};
  return SetOneOf(format, "format", *text,
                  {{"f32", GridFormat::kF32},
                   {"r16", GridFormat::kR16},
                   {"geotiff", GridFormat::kGeoTiff},
                   {"png16", GridFormat::kPng16},
                   {"json", GridFormat::kJson}});
}

Result<void> SetRange(const std::string* text, GridQuery& query) {
  if (text == nullptr) return {};
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
  Result<SentTexts> parsed = GridTextsOf(text);
  if (!parsed) return tl::unexpected(parsed.error());
  SentTexts& texts = *parsed;
  GridQuery query;
  const std::string* const bbox = TextOf(texts, "bbox");
  const auto box = bbox != nullptr ? NumbersOf<4>(*bbox) : std::nullopt;
  if (!box) return InvalidGrid("bbox=west,south,east,north is needed: four numbers in units of the crs");
  query.grid.west = (*box)[0], query.grid.south = (*box)[1], query.grid.east = (*box)[2], query.grid.north = (*box)[3];
  for (const Result<void>& set :
       {SetSize(texts, query.grid), SetCrs(TextOf(texts, "crs"), query.grid),
        SetGridFormat(TextOf(texts, "format"), query.format), SetRange(TextOf(texts, "range"), query)}) {
    if (!set) return tl::unexpected(set.error());
  }
  if (const std::string* const datum = TextOf(texts, "datum")) {
    if (const Result<void> set = SetDatum(query.datum, *datum); !set) return tl::unexpected(set.error());
  }
  texts.erase("format");  // of the grid; ParseDrawn would take it for that of tiles
  Result<std::optional<tiler::DrawnSurface>> drawn = ParseDrawn(texts);
  if (!drawn) return tl::unexpected(drawn.error());
  query.drawn = *std::move(drawn);
  query.names_source = texts.contains("surface") && !query.drawn;
  if (query.drawn && query.datum != dem::HeightDatum::kEllipsoid) {
    return InvalidGrid("surface=served has ellipsoidal heights alone, as tiles have");
  }
  return query;
}

}  // namespace terrace::server
