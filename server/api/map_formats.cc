#include "server/api/map_formats.h"

#include <algorithm>

#include "proto/documents/map_picture.h"
#include "tiler/map/contour_tile.h"
#include "tiler/tile/tile_bounds.h"

namespace terrace::server {
namespace {

bool IsImagery(tiler::TileFormat format) {
  return format == tiler::TileFormat::kImagery || format == tiler::TileFormat::kGeodeticImagery;
}

}  // namespace

int MaxMapLevel(const DatasetView& dataset, tiler::TileFormat format, int size) {
  const int above = size == 512 ? 1 : 0;
  switch (format) {
    case tiler::TileFormat::kImagery:
      return std::max(dataset.imagery->max_mercator_depth - above, 0);
    case tiler::TileFormat::kGeodeticImagery:
      return std::max(dataset.imagery->max_geodetic_level - above, 0);
    default:
      return MaxHeightTileLevel(dataset, size);
  }
}

int MinMapLevel(const MapTileParameters& parameters) {
  if (parameters.map.interval_cm == 0) return 0;
  int level = 0;
  while (tiler::MinIntervalCm(level) > parameters.map.interval_cm) ++level;
  return level;
}

dem::GeoBounds MapBounds(const DatasetView& dataset, tiler::TileFormat format) {
  return IsImagery(format) ? dataset.imagery->bounds : dataset.bounds;
}

Result<void> CheckHasImagery(const DatasetView& dataset, tiler::TileFormat format) {
  if (!IsImagery(format) || dataset.imagery) return {};
  return MakeError(ErrorCode::kNotFound, "the dataset has no imagery; its option \"imagery\" names an image");
}

Result<void> ReadMapTile(std::string_view query, const DatasetView& dataset, tiler::TileRequest& tile) {
  if (Result<void> has = CheckHasImagery(dataset, tile.format); !has) return has;
  const Result<MapTileParameters> parameters = ParseMapParameters(query, tile.format);
  if (!parameters) return tl::unexpected(parameters.error());
  const bool is_there =
      tile.key.level <= MaxMapLevel(dataset, tile.format, parameters->size) &&
      Intersects(MapBounds(dataset, tile.format), tiler::TileBounds(tile.key, tiler::IsMercator(tile.format)));
  if (!is_there) {
    return MakeError(ErrorCode::kNotFound,
                     "the dataset has no such tile; the tiles.json of this layer tells the bounds and levels of what "
                     "it has");
  }
  const proto::PictureFormat picture = tile.map.picture;
  tile.map = parameters->map;
  tile.map.picture = picture;
  if (tile.format != tiler::TileFormat::kContours) {
    tile.side_px = parameters->size;
    return {};
  }
  const std::uint32_t least = tiler::MinIntervalCm(tile.key.level);
  if (tile.map.interval_cm == 0) tile.map.interval_cm = tiler::DefaultIntervalCm(tile.key.level);
  if (tile.map.interval_cm < least) {
    return MakeError(ErrorCode::kInvalidArgument, "interval must be at least {} m at level {}", least / 100.0,
                     tile.key.level);
  }
  return {};
}

std::string_view MapTileType(const tiler::TileRequest& tile) {
  return tile.format == tiler::TileFormat::kContours ? "application/vnd.mapbox-vector-tile"
                                                     : proto::MediaTypeOf(tile.map.picture);
}

}  // namespace terrace::server
