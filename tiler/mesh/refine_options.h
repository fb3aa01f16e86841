// Options of a tile's refinement. With them the tile keeps every error bound, and its edges match those of its
// neighbours. They depend on the level and row of the tile, its border samples, the range bounds of the
// tile and its neighbours (at a pole, of the whole dataset), the dataset's criterion, and the edits on the tile. They
// do not depend on the error: a refinement serves every error (engine/tin/refinement.h).
#pragma once

#include <span>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/tin/greedy.h"
#include "proto/mesh/edge_steps.h"
#include "proto/tile_samples.h"

namespace terrace::tiler {

// Squares of metres between columns, for rows at these latitudes (Curvature::east_m2). `step`: degrees.
std::vector<double> SquaredEastSteps(std::span<const double> latitudes, double step);

// `finest`: height steps of the edges for the smallest error (MakeEdgeSteps).
tin::GreedyOptions BaseRefineOptions(const proto::TileSamples& samples, const proto::EdgeSteps& finest);

// Height steps of a tile's edges for these errors, equal for both tiles that share an edge.
proto::EdgeSteps EdgeStepsOf(const dem::ElevationModel& model, const geo::TileKey& key,
                             const proto::EdgeErrors& errors);

// BaseRefineOptions with the criterion and the limits of edits.
tin::GreedyOptions RefineOptionsOf(const dem::ElevationModel& model, const proto::TileSamples& samples,
                                   tin::Criterion criterion);

}  // namespace terrace::tiler
