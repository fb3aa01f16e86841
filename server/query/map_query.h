// Parsed parameters of tiles for maps and of their TileJSON: hillshades, slopes, contours, imagery. Pure.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "proto/documents/picture_types.h"
#include "tiler/tile/tile_request.h"

namespace terrace::server {

struct MapTileParameters {
  int size = tiler::kSidesPx[0];
  tiler::MapParameters map;                     // interval_cm is 0 if none is requested
  std::optional<proto::PictureFormat> picture;  // TileJSON's `format`
};

// Parses the parameters of a format: `azimuth`, `altitude`, `zfactor` and `size` of hillshades; `style` and `size` of
// slopes; `interval` of contours; `size` of imagery. `in_tile_json`: also `format` of pictures. `v` may be repeated.
// kInvalidArgument, with a message for the client: an unknown or repeated parameter, or a value out of range.
Result<MapTileParameters> ParseMapParameters(std::string_view query, tiler::TileFormat format,
                                             bool in_tile_json = false);

// The query of a tile template: parameters that differ from the defaults, each with '&' before it.
std::string MapTileQuery(const MapTileParameters& parameters);

}  // namespace terrace::server
