// Lines of sight over the meshes that clients decode.
#pragma once

#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "tiler/surface/drawn_tiles.h"

namespace terrace::tiler {

// Samples of the finest source, or of tiles, that the rays of one request may cross together.
inline constexpr double kMaxSamplesAlong = 2e8;

// kInvalidArgument, with a message for the client: the rays cross more.
Result<void> CheckSamplesAlong(const dem::ElevationModel& model, std::span<const dem::SightRay> rays);
// The same for a dataset without sources. Counts 256 samples along a tile's side, and at least one every 500 m.
Result<void> CheckSamplesAlong(int level, std::span<const dem::SightRay> rays);

// As ElevationModel::LookAlong, over the meshes of `level` and, where that is not available, of ancestors.
// kInvalidArgument: the rays cross more than kMaxTilesRead tiles. Other errors: those of `find_mesh`.
Result<std::vector<dem::SightAnswer>> LookAlongDrawn(const HasTile& has_tile, int level,
                                                     std::span<const dem::SightRay> rays,
                                                     const dem::SightOptions& options, const FindMesh& find_mesh,
                                                     const std::stop_token& stop);

}  // namespace terrace::tiler
