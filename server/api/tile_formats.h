// The tile formats: one row each. tiler::TilePipeline builds and encodes tiles; it selects the encoder by the row's
// `format`.
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
  std::string_view (*media_type)(const tiler::TileRequest& tile);
  std::string_view (*vary)(const tiler::TileRequest& tile);  // the headers that a reply depends on, as in Response
  // Reads the parameters of a URL and sets the rest of the request; its dataset, key and format are set. kNotFound: the
  // dataset has no such tile. kInvalidArgument: see ParseTileParameters and ParseHeightTileParameters.
  Result<void> (*read)(std::string_view query, const RequestFields& fields, const DatasetView& dataset,
                       tiler::TileRequest& tile);
};

const TileFormat& RowOf(tiler::TileFormat format);

// Removes the suffix of a tile's URL from its last segment, and returns the row of the format; null if no suffix
// matches.
const TileFormat* CutSuffix(std::string_view& name);

}  // namespace terrace::server
