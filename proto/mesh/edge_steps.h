// The height steps of a tile's edges, chosen so that neighbours decode equal heights.
//
// quantized-mesh stores a height as a 15-bit multiple of the tile's own step. Two tiles agree on an edge bit for bit if
// the heights there are multiples of a step that the steps of both tiles divide. All steps here are powers of two. A
// tile's own step (quantize_tile.h) is the finest that its relief allows, so an edge's step only has to be at least
// what either tile needs. The need of a tile is derived from the RangeBound of its heights and not from its samples,
// because the neighbour that computes the same edge has not read them:
//
//   NeededStep(T) = smallest 2^k >= range(T) / 16384      half of the format's 32767 steps; the rest is for rounding up
//   edge step     = max(largest 2^k <= error / 8, NeededStep of both tiles)
//   corner step   = the same over the four tiles that meet
//   on a pole     : the same with the NeededStep of the whole dataset, for the edge and its corners
//
// Proof that a tile's own step divides: it is a power of two, so it only has to be at most every edge's step. Let w be
// the step requested for the error, m the tile's NeededStep, S the coarsest step of its edges. Rounding widens the
// relief to at most 16384 m + S, and every edge's step is at least M = max(m, w). If S = M, that is 16385 M, less than
// 32767 M. Else S is the NeededStep of a neighbour, at most 2 metres for any relief on Earth (below 32 km), and
// 16384 M + 2 metres <= 32767 M holds since M is at least 2^-10 metres.
#pragma once

#include <array>

#include "engine/tin/greedy.h"

namespace terrace::proto {

// Heights are multiples of 2^-10 m, so no edge needs a finer step.
inline constexpr double kHeightResolution = 1.0 / 1024;

// Corners in the order south-west, south-east, north-east, north-west.
struct EdgeSteps {
  std::array<double, 4> side{};    // metres, by tin::Side: interior samples of the edge
  std::array<double, 4> corner{};  // metres

  // The coarsest step on a side, its two corners included.
  double Coarsest(tin::Side side) const;
};

// The strictest bound on the errors of samples: on each side, and on the four edges that meet at each corner. It is the
// tile's error unless local limits (engine/tin/sample_limits.h) are smaller. Neighbours have equal errors on shared
// edges and corners. With limits, let L be the least step of the tile's edges. It may be below w, but MakeEdgeSteps
// keeps it at least w / 8192. If S is w, it is at most 8192 L, so that 16384 L + S <= 24576 L < 32767 L. If S is a
// neighbour's NeededStep, the proof at the top of this file holds.
struct EdgeErrors {
  explicit EdgeErrors(double error_m) : tile(error_m) {
    side.fill(error_m);
    corner.fill(error_m);
  }
  double tile;
  std::array<double, 4> side, corner;
};

// The largest power of two that is at most `value`. Precondition: `value` > 0.
double PowerOfTwoAtMost(double value);

double NeededStep(double min_height, double max_height);

// `needed[row][column]` holds NeededStep of the tile (row = column = 1) and its eight neighbours, row 0 in the SOUTH.
// `pole_step`: NeededStep of all heights of the dataset. `at_south_pole` / `at_north_pole`: the tile touches that pole;
// the rows of `needed` beyond it are not read.
EdgeSteps MakeEdgeSteps(const EdgeErrors& errors, const std::array<std::array<double, 3>, 3>& needed, double pole_step,
                        bool at_south_pole, bool at_north_pole);

// The step of a vertex: that of its edge or corner; 0 inside the tile.
double StepAt(const EdgeSteps& steps, int x, int y, int cells);

// The multiple of `step` nearest to `height`; halves go up.
double SnapHeight(double height, double step);

}  // namespace terrace::proto
