#include "engine/dem/corner_edges.h"

#include <cstddef>
#include <cstdint>

namespace terrace::dem {

std::array<std::vector<NodeWindow>, 4> EdgesBeyondCorners(const geo::Lattice& lattice, const geo::TileKey& key) {
  const int inner = lattice.cells - 1;
  const std::int64_t west = lattice.FirstColumn(key), south = lattice.FirstRow(key);
  std::array<std::vector<NodeWindow>, 4> edges;
  for (std::size_t corner = 0; corner < 4; ++corner) {
    const bool is_east = corner == 1 || corner == 2, is_north = corner >= 2;
    const std::int64_t column = is_east ? west + lattice.cells : west, row = is_north ? south + lattice.cells : south;
    const std::int64_t beside = is_east ? column + 1 : column - inner;
    edges[corner].push_back({FloorMod(beside, lattice.columns()), row, inner, 1});
    if (is_north ? key.y + 1 == geo::TileRows(key.level) : key.y == 0) continue;
    edges[corner].push_back({FloorMod(column, lattice.columns()), is_north ? row + 1 : row - inner, 1, inner});
  }
  return edges;
}

}  // namespace terrace::dem
