// Options of a tile's refinement. With them the tile keeps every error bound, and its edges match those of its
// neighbours. They depend on the level and row of the tile, its border samples, and the height ranges of the
// neighbours. They do not depend on the error: a refinement serves every error (engine/tin/refinement.h).
// RefineOptionsOf (tile_mesher.h) adds the criterion and the limits of edits.
#pragma once

#include "engine/tin/greedy.h"
#include "proto/lattice_view.h"
#include "proto/mesh/edge_steps.h"

namespace terrace::tiler {

// `needed`: height steps of the edges for the smallest error (MakeEdgeSteps).
tin::GreedyOptions BaseRefineOptions(const proto::LatticeView& lattice, const proto::EdgeSteps& needed);

}  // namespace terrace::tiler
