// Which tiles tell how far the served surface is from the sources at given points. Pure.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "engine/geo/tile_key.h"
#include "server/tiles/dataset_view.h"

namespace terrace::server {

// Each is built where no cache has it.
inline constexpr std::size_t kMaxCertifiedTiles = 64;

struct CertifiedPoints {
  std::vector<geo::TileKey> tiles;              // each once
  std::vector<std::size_t> tile_of_point;       // in `tiles`
  std::vector<std::optional<double>> errors_m;  // by tile, as they become known; nothing: the tile states none
};

// Of each point the deepest tile that there is, down to `deepest`. kInvalidArgument, with a message for the client:
// more than kMaxCertifiedTiles. kCancelled: a stop was requested.
Result<CertifiedPoints> TilesOf(const DatasetView& dataset, std::span<const dem::GeoPosition> points, int deepest,
                                const std::stop_token& stop = {});

}  // namespace terrace::server
