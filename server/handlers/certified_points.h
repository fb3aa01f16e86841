// Selects the tiles whose certified errors hold at given points. Pure.
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

// Limit of tiles per request: each must be built if it is not cached.
inline constexpr std::size_t kMaxCertifiedTiles = 64;

struct CertifiedPoints {
  std::vector<geo::TileKey> tiles;              // without duplicates
  std::vector<std::size_t> tile_of_point;       // index into `tiles`
  std::vector<std::optional<double>> errors_m;  // by tile; nothing: the tile states none
};

// Returns the deepest available tile of each point, down to level `deepest`. kInvalidArgument, with a message for the
// client: more than kMaxCertifiedTiles. kCancelled: a stop was requested.
Result<CertifiedPoints> TilesOf(const DatasetView& dataset, std::span<const dem::GeoPosition> points, int deepest,
                                const std::stop_token& stop = {});

}  // namespace terrace::server
