// Options of a tile's refinement. With them the tile keeps every error bound, and its edges match those of its
// neighbours. They depend on the level and row of the tile, its border samples, the height ranges of the
// neighbours, the dataset's criterion, and the edits on the tile. They do not depend on the error: a refinement serves
// every error (engine/tin/refinement.h).
#pragma once

#include "engine/dem/dem_source.h"
#include "engine/tin/greedy.h"
#include "proto/lattice_view.h"
#include "proto/mesh/edge_steps.h"

namespace terrace::tiler {

// `needed`: height steps of the edges for the smallest error (MakeEdgeSteps).
tin::GreedyOptions BaseRefineOptions(const proto::LatticeView& lattice, const proto::EdgeSteps& needed);

// Height steps of a tile's edges for these errors, equal for both tiles that share an edge.
proto::EdgeSteps EdgeStepsOf(const dem::DemSource& source, const geo::TileKey& key, const proto::EdgeErrors& errors);

// BaseRefineOptions with the criterion and the limits of edits.
tin::GreedyOptions RefineOptionsOf(const dem::DemSource& source, const proto::LatticeView& lattice,
                                   tin::Criterion criterion);

}  // namespace terrace::tiler
