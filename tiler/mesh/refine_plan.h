// How a tile is refined so that it keeps any error and matches its neighbours: derived from its level, its own border
// samples, and for the edges' height grid from height ranges of the neighbours. Not from the error: a refinement serves
// every error (engine/tin/refinement.h).
#pragma once

#include "engine/tin/greedy.h"
#include "proto/lattice_view.h"
#include "proto/mesh/edge_steps.h"

namespace terrace::tiler {

// Everything that decides the edges is a function of the level and of the edge's own samples and steps.
// `needed`: the steps that the edges' heights need at any error, MakeEdgeSteps for the smallest one.
tin::GreedyOptions MakeRefinePlan(const proto::LatticeView& lattice, const proto::EdgeSteps& needed);

}  // namespace terrace::tiler
