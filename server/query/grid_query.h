// A parsed request for a grid of heights. Pure.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "engine/export/output_grid.h"
#include "tiler/surface/drawn_surface.h"

namespace terrace::server {

enum class GridFormat : std::uint8_t { kF32, kR16, kGeoTiff, kPng16, kJson };

// Integers of 16 bits, or the description of them: offset and scale. They have no value for a void.
constexpr bool HasIntegers(GridFormat format) { return format != GridFormat::kF32 && format != GridFormat::kGeoTiff; }

struct GridQuery {
  dem::GridRequest grid;
  GridFormat format = GridFormat::kF32;
  dem::HeightDatum datum = dem::HeightDatum::kEllipsoid;
  std::optional<dem::HeightRange> range;     // of the integers; nothing: that of the heights
  std::optional<tiler::DrawnSurface> drawn;  // nothing: the surface of the sources
  bool names_source = false;                 // surface=source was sent
};

// `bbox=west,south,east,north` in units of `crs=EPSG:CODE` (4326), `width=N&height=N` or `spacing=S`, `format`,
// `datum`, `range=MIN,MAX`, and the parameters of surfaces except `format` and `compression` (drawn_parameters.h); `v`
// may be repeated. kInvalidArgument: the message is for the client.
Result<GridQuery> ParseGrid(std::string_view query);

}  // namespace terrace::server
