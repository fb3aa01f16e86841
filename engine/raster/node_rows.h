// Rows of nodes: the places of their samples and the heights between them, with SIMD. Results are bit-equal on all
// instruction sets, and to those of GridAxes::CellAt and Interpolate for each node.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/raster/grid_cells.h"

namespace terrace::dem {

// Interpolates along rows of nodes.
class NodeRows {
 public:
  // For nodes `first` to `end` of each row. The arguments must outlive this object.
  NodeRows(const std::vector<float>& samples, const GridWindow& window, const NodeCells& cells, std::size_t first,
           std::size_t end);

  // Returns one height per node from `first` on. NaN: a sample with a nonzero weight is void, or this
  // function does not handle the node; call Interpolate for it. Undefined if the node's cell lies outside the window.
  // Valid until the next call. Precondition: if the cells are separable, those of the row lie in the window's rows.
  std::span<const double> Row(std::size_t j);

 private:
  struct Line {
    std::int64_t row = -1;  // of samples
    std::vector<double> heights;
  };

  const Line& LineOf(std::int64_t row);

  const std::vector<float>& samples_;
  const GridWindow window_;
  const NodeCells& cells_;
  const std::size_t first_;
  std::vector<std::int32_t> west_, east_;  // by node, the columns of its samples in the window
  std::vector<double> weights_;            // of the eastern ones
  std::array<Line, 2> lines_;
  std::vector<double> heights_;
};

// RoundHeight of each height plus what is added to it. `added`: one per height, or empty. Precondition: `rounded` has
// one entry per height.
void RoundHeights(std::span<const double> heights, std::span<const double> added, std::span<float> rounded);

}  // namespace terrace::dem
