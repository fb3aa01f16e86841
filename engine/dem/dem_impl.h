// What a DemSource holds. Everything is settled by Open; the handle pool alone changes later, under its own lock.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "engine/dem/dem_source.h"
#include "engine/dem/footprint.h"
#include "engine/dem/gdal_handle.h"
#include "engine/dem/georeference.h"
#include "engine/dem/level_plan.h"
#include "engine/dem/range_table.h"
#include "engine/dem/sample_grid.h"

namespace terrace::dem {

class DemSource::Impl {
 public:
  Impl(std::string path, StampedFiles files, Georeference where)
      : handles(std::move(path), std::move(files)), georeference(std::move(where)) {}

  Result<TileHeights> Read(const geo::TileKey& key, const std::stop_token& stop);
  // `what` is read, for messages.
  Result<std::vector<float>> ReadNodes(int level, const NodeWindow& window, const std::string& what,
                                       const std::stop_token& stop);
  Result<std::vector<float>> ReadMercator(int depth, const NodeWindow& window, const std::stop_token& stop);
  Result<std::vector<float>> ReadPoints(std::span<const GeoPosition> points, const std::stop_token& stop);
  HeightRange RangeBound(const geo::TileKey& key) const;

  const LevelPlan& Plan(int level) const;  // 0 .. geo::kMaxLevel, also beyond the deepest level served

  HandlePool handles;
  const Georeference georeference;
  RasterLayout layout;
  Footprint footprint;  // padded: outside it there is nothing but the floor
  std::vector<LevelPlan> levels;
  std::vector<int> mercator_factors;  // by depth
  std::vector<std::vector<geo::TileRange>> available;
  RangeTable table;
  float floor = 0;
  int max_void_gap = 0;                              // source samples
  std::array<std::optional<float>, 2> pole_heights;  // south, north: of geographic sources that reach them
  DemInfo info;
  std::uint64_t fingerprint = 0;

 private:
  Result<std::vector<float>> ReadFilled(GDALDataset& dataset, int factor, const GridWindow& window,
                                        const std::stop_token& stop);
  Result<std::vector<float>> ReadFloored(std::span<const Position> positions, int factor, const std::string& what,
                                         const std::stop_token& stop);
  bool IsInside(const Position& position) const;
  std::optional<float> PoleHeight(const geo::Lattice& lattice, std::int64_t row) const;
};

// Heights are multiples of 2^-10 m: libm's last bits, which differ between processors, end here.
float RoundHeight(double metres);

}  // namespace terrace::dem
