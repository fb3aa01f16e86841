// How a tile is refined so that it keeps its error and matches its neighbours: derived from its level, its error and
// its own border samples, and for the edges' height grid from height ranges of the neighbours.
#pragma once

#include "engine/tin/greedy.h"
#include "proto/edge_steps.h"
#include "proto/lattice_view.h"

namespace terrace::server {

struct RefinePlan {
  bool curved = false;  // a triangle over the whole tile would sag more than 1 % of the error
  tin::GreedyOptions options;
};

// Everything that decides the edges is a function of (level, error, the edge's own samples and steps).
RefinePlan MakeRefinePlan(const proto::LatticeView& lattice, const proto::EdgeSteps& steps, double error_m);

}  // namespace terrace::server
