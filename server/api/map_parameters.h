// Parameters of tiles for maps and of their TileJSON: hillshades, slopes, contours, imagery.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "engine/core/result.h"
#include "proto/documents/map_picture.h"
#include "server/tiles/catalog.h"
#include "tiler/tile/tile_request.h"

namespace terrace::server {

struct MapTileParameters {
  int size = tiler::kSidesPx[0];
  tiler::MapParameters map;                     // interval_cm is 0 if none is requested
  std::optional<proto::PictureFormat> picture;  // TileJSON's `format`
};

// The pixels along an edge of a Web Mercator tile. kInvalidArgument: not one of tiler::kSidesPx.
Result<void> SetTileSize(int& size, std::string_view text);

// Parses the parameters of a format: `azimuth`, `altitude`, `zfactor` and `size` of hillshades; `style` and `size` of
// slopes; `interval` of contours; `size` of imagery. `in_tile_json`: also `format` of pictures. `v` may be repeated.
// kInvalidArgument, with a message for the client: an unknown or repeated parameter, or a value out of range.
Result<MapTileParameters> ParseMapParameters(std::string_view query, tiler::TileFormat format,
                                             bool in_tile_json = false);

// The query of a tile template: parameters that differ from the defaults, each with '&' before it.
std::string MapTileQuery(const MapTileParameters& parameters);

// The level of a format's finest tiles at this size; at least 0. Precondition for imagery: the dataset has an image.
int MaxMapLevel(const DatasetView& dataset, tiler::TileFormat format, int size);
// The level of the coarsest tiles that these parameters are valid for: coarse contours need a large interval.
int MinMapLevel(const MapTileParameters& parameters);
// Where tiles of a format are. Precondition: as above.
dem::GeoBounds MapBounds(const DatasetView& dataset, tiler::TileFormat format);

// kNotFound: the dataset has no imagery, and the format needs it.
Result<void> CheckHasImagery(const DatasetView& dataset, tiler::TileFormat format);

// For TileFormatRow::read and media_type of formats for maps.
Result<void> ReadMapTile(std::string_view query, const DatasetView& dataset, tiler::TileRequest& tile);
std::string_view MapTileType(const tiler::TileRequest& tile);

}  // namespace terrace::server
