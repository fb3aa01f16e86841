// The formats of tiles for maps: what a dataset has of them, and their requests.
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "server/query/map_query.h"
#include "server/tiles/catalog.h"
#include "tiler/tile/tile_request.h"

namespace terrace::server {

// The level of a format's finest tiles at this size; at least 0. Precondition for imagery: the dataset has an image.
int MaxMapLevel(const DatasetView& dataset, tiler::TileFormat format, int size);
// The level of the coarsest tiles that these parameters are valid for: coarse contours need a large interval.
int MinMapLevel(const MapTileParameters& parameters);
// Where tiles of a format are. Precondition for imagery: the dataset has an image.
dem::GeoBounds MapBounds(const DatasetView& dataset, tiler::TileFormat format);

// kNotFound: the dataset has no imagery, and the format needs it.
Result<void> CheckHasImagery(const DatasetView& dataset, tiler::TileFormat format);

// TileFormatRow::read and TileFormatRow::media_type of the formats for maps.
Result<void> ReadMapTile(std::string_view query, const DatasetView& dataset, tiler::TileRequest& tile);
std::string_view MapTileType(const tiler::TileRequest& tile);

}  // namespace terrace::server
