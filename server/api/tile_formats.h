// The formats that tiles are served in: one row each. How a tile of a format is built and encoded is
// tiler::TilePipeline's business, which the row's `format` chooses by.
#pragma once

#include <string_view>

#include "engine/core/result.h"
#include "server/http/request.h"
#include "server/tiles/dataset_view.h"
#include "tiler/tile_request.h"

namespace terrace::server {

struct TileFormat {
  tiler::TileFormat format;
  std::string_view suffix;  // of the URL: ".terrain"
  bool is_mercator;         // counted in Web Mercator's XYZ scheme; else in TMS geodetic
  bool varies;              // by Accept and Accept-Encoding
  std::string_view (*media_type)(const tiler::TileRequest& tile);
  // Reads the parameters of a URL. Sets what else the tile is, of its dataset, key and format; kNotFound: the dataset
  // has no such tile; kInvalidArgument: see ParseTileParameters and ParseHeightTileParameters.
  Result<void> (*read)(std::string_view query, const RequestFields& fields, const DatasetView& dataset,
                       tiler::TileRequest& tile);
};

const TileFormat& RowOf(tiler::TileFormat format);

// Cuts the suffix of a tile's URL off its last segment; null where it has none of them.
const TileFormat* CutSuffix(std::string_view& name);

}  // namespace terrace::server
