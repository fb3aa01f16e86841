// The size and time of a bake, estimated from a few of its tiles.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "bake/baker.h"
#include "engine/core/result.h"
#include "tiler/tile_pipeline.h"

namespace terrace::bake {

struct LevelEstimate {
  std::string format;  // archive::FolderOf
  int level = 0;
  std::uint64_t tiles = 0;
  double bytes_per_tile = 0;  // mean of the samples, or assumed
  double milliseconds_per_tile = 0;
};

struct Estimate {
  std::vector<LevelEstimate> levels;
  std::uint64_t tiles = 0, files = 0;
  // Of `files`: those with more than one tile, and the file of the top levels. A file of one tile exists only so that
  // its parent has four children.
  std::uint64_t subtree_files = 0;
  std::uint64_t sampled = 0;  // tiles that were built for the estimate
  double bytes = 0, core_hours = 0;
};

// Builds some tiles of each level, in groups of neighbours as the bake does. kCancelled: stopped. Other errors: those
// of TilePipeline::Build.
Result<Estimate> EstimateBake(const tiler::TilePipeline& pipeline, const std::vector<Target>& targets,
                              const UnitPlan& plan, const std::stop_token& stop);

// From assumed sizes and times, the same for every tile.
Estimate EstimateWith(const Pyramid& tiles, double bytes_per_tile, double milliseconds_per_tile);

}  // namespace terrace::bake
