// Checks requests that do not come from the server's parser, such as those of embedders.
#pragma once

#include "engine/core/result.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

// Whether a tile of the format can exist and the parameters that the format uses have values that TileRequest permits.
// The dataset is not considered. kNotFound: no level has such a tile, or its pixels are finer
// than geo::kMaxLevel. kInvalidArgument: another member; the message
// names it.
Result<void> CheckRequest(const TileRequest& request);

}  // namespace terrace::tiler
