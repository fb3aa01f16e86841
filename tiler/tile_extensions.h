// The extensions of a quantized-mesh tile.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "proto/lattice_view.h"
#include "proto/mesh/quantized_mesh.h"
#include "tiler/tile_pipeline.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// Adds the water mask and the metadata to `tile`, if `request` asks for them and the dataset has them. Returns the
// extensions to encode, including normals. kUnavailable: the water raster cannot be read now. kCancelled: stopped.
Result<proto::QuantizedMeshOptions> AddExtensions(const Dataset& dataset, const TileRequest& request,
                                                  const proto::LatticeView& lattice, proto::QuantizedTile& tile,
                                                  const std::stop_token& stop);

}  // namespace terrace::tiler
