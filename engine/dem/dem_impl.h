// What a DemSource holds. Everything is settled by Open.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "engine/dem/dem_source.h"
#include "engine/dem/sheet.h"

namespace terrace::dem {

class DemSource::Impl {
 public:
  // `what` is read, for messages.
  Result<std::vector<float>> ReadNodes(int level, const NodeWindow& window, const std::string& what,
                                       const std::stop_token& stop) const;
  Result<TileHeights> Read(const geo::TileKey& key, const std::stop_token& stop) const;
  Result<std::vector<float>> ReadMercator(int depth, const NodeWindow& window, const std::stop_token& stop) const;
  Result<std::vector<float>> ReadPoints(std::span<const GeoPosition> points, const std::stop_token& stop) const;
  HeightRange RangeBound(const geo::TileKey& key) const;

  const geo::Lattice& LatticeOf(int level) const;  // 0 .. geo::kMaxLevel, also beyond the deepest level served

  std::vector<Sheet> sheets;  // the first that has a height at a place gives it
  std::vector<geo::Lattice> lattices;
  std::vector<std::vector<geo::TileRange>> available;
  float floor = 0;
  DemInfo info;
  std::uint64_t fingerprint = 0;
};

}  // namespace terrace::dem
