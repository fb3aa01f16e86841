// What a quantized-mesh tile carries besides its mesh.
#pragma once

#include <stop_token>

#include "engine/core/result.h"
#include "proto/lattice_view.h"
#include "proto/mesh/quantized_mesh.h"
#include "tiler/tile_pipeline.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// Puts the water mask and the metadata that `request` asks for, as far as the dataset has them, into `tile`. What comes
// back names every extension that the tile is to be encoded with, normals included.
// kUnavailable: the water raster cannot be read now. kCancelled: stopped.
Result<proto::QuantizedMeshOptions> AddExtensions(const Dataset& dataset, const TileRequest& request,
                                                  const proto::LatticeView& lattice, proto::QuantizedTile& tile,
                                                  const std::stop_token& stop);

}  // namespace terrace::tiler
