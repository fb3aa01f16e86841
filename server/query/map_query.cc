#include "server/query/map_query.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <iterator>
#include <vector>

#include "server/http/text.h"
#include "server/query/tile_query.h"
#include "tiler/map/contour_tile.h"

namespace terrace::server {
namespace {

// A reader of one parameter's value. kInvalidArgument: the message begins with what the value must be.
using SetParameter = Result<void> (*)(std::string_view text, MapTileParameters& parameters);

Result<void> SetSize(std::string_view text, MapTileParameters& parameters) {
  return SetTileSize(parameters.size, text);
}

Result<void> SetAzimuth(std::string_view text, MapTileParameters& parameters) {
  const auto degrees = PlainDecimal(text, /*max_digits=*/3);
  if (!degrees || *degrees > 360) {
    return MakeError(ErrorCode::kInvalidArgument, "azimuth must be a whole number of degrees from 0 to 360");
  }
  parameters.map.azimuth_deg = static_cast<std::uint16_t>(*degrees % 360);
  return {};
}

Result<void> SetAltitude(std::string_view text, MapTileParameters& parameters) {
  const auto degrees = PlainDecimal(text, /*max_digits=*/2);
  if (!degrees || *degrees > 90) {
    return MakeError(ErrorCode::kInvalidArgument, "altitude must be a whole number of degrees from 0 to 90");
  }
  parameters.map.altitude_deg = static_cast<std::uint8_t>(*degrees);
  return {};
}

// A number rounded to hundredths, of which it returns how many; nothing if the number is outside `min` .. `max`.
std::optional<std::uint32_t> Hundredths(std::string_view text, double min, double max) {
  const std::optional<double> number = PositiveNumber(text);
  if (!number || !(*number >= min && *number <= max)) return std::nullopt;
  return static_cast<std::uint32_t>(std::floor(*number * 100 + 0.5));
}

Result<void> SetZFactor(std::string_view text, MapTileParameters& parameters) {
  const auto hundredths = Hundredths(text, 0.01, 100);
  if (!hundredths) return MakeError(ErrorCode::kInvalidArgument, "zfactor must be a number from 0.01 to 100");
  parameters.map.z_factor_hundredths = static_cast<std::uint16_t>(*hundredths);
  return {};
}

Result<void> SetStyle(std::string_view text, MapTileParameters& parameters) {
  return SetOneOf(parameters.map.slope_style, "style", text,
                  {{"colors", tiler::SlopeStyle::kColors}, {"degrees", tiler::SlopeStyle::kDegrees}});
}

Result<void> SetInterval(std::string_view text, MapTileParameters& parameters) {
  const auto cm = Hundredths(text, 0.1, tiler::kMaxIntervalCm / 100.0);
  if (!cm) return MakeError(ErrorCode::kInvalidArgument, "interval must be a number of metres from 0.1 to 10000");
  parameters.map.interval_cm = *cm;
  return {};
}

Result<void> SetPicture(std::string_view text, MapTileParameters& parameters) {
  using proto::PictureFormat;
  return SetOneOf(parameters.picture, "format", text,
                  {{"png", PictureFormat::kPng}, {"webp", PictureFormat::kWebp}, {"jpg", PictureFormat::kJpeg}});
}

struct MapParameterRow {
  const char* name;
  bool (*is_of)(tiler::TileFormat format);
  SetParameter set;
  bool in_tile_json_only = false;
};

constexpr MapParameterRow kRows[] = {
    {"size", [](tiler::TileFormat format) { return format != tiler::TileFormat::kContours; }, SetSize},
    {"azimuth", [](tiler::TileFormat format) { return format == tiler::TileFormat::kHillshade; }, SetAzimuth},
    {"altitude", [](tiler::TileFormat format) { return format == tiler::TileFormat::kHillshade; }, SetAltitude},
    {"zfactor", [](tiler::TileFormat format) { return format == tiler::TileFormat::kHillshade; }, SetZFactor},
    {"style", [](tiler::TileFormat format) { return format == tiler::TileFormat::kSlope; }, SetStyle},
    {"interval", [](tiler::TileFormat format) { return format == tiler::TileFormat::kContours; }, SetInterval},
    {"format", [](tiler::TileFormat format) { return format != tiler::TileFormat::kContours; }, SetPicture,
     /*in_tile_json_only=*/true},
};

}  // namespace

Result<MapTileParameters> ParseMapParameters(std::string_view query, tiler::TileFormat format, bool in_tile_json) {
  std::vector<const char*> names;
  std::vector<SetParameter> set;
  for (const MapParameterRow& row : kRows) {
    if (!row.is_of(format) || (row.in_tile_json_only && !in_tile_json)) continue;
    names.push_back(row.name);
    set.push_back(row.set);
  }
  MapTileParameters parameters;
  const Result<void> read =
      ReadParameters(query, names, [&](std::size_t i, const std::string& value) { return set[i](value, parameters); });
  if (!read) return tl::unexpected(read.error());
  return parameters;
}

std::string MapTileQuery(const MapTileParameters& parameters) {
  const MapTileParameters defaults;
  const tiler::MapParameters& map = parameters.map;
  std::string query;
  const auto add = [to = std::back_inserter(query)](std::string_view name, const auto& value) {
    fmt::format_to(to, "&{}={}", name, value);
  };
  if (map.azimuth_deg != defaults.map.azimuth_deg) add("azimuth", map.azimuth_deg);
  if (map.altitude_deg != defaults.map.altitude_deg) add("altitude", map.altitude_deg);
  if (map.z_factor_hundredths != defaults.map.z_factor_hundredths) add("zfactor", map.z_factor_hundredths / 100.0);
  if (map.slope_style != defaults.map.slope_style) add("style", "degrees");
  if (map.interval_cm != 0) add("interval", map.interval_cm / 100.0);
  if (parameters.size != defaults.size) add("size", parameters.size);
  return query;
}

}  // namespace terrace::server
