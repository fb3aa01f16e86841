#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/tin/mesh_error.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/rasters.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

constexpr std::array<double, 3> kErrors = {1, 5, 20};

Contest Contend(Environment& environment, const std::string& name, const std::vector<tin::HeightField>& fields,
                const tin::GreedyGoal& goal) {
  for (const tin::HeightField& field : fields) CheckMesh(name, field, goal, MeshOf(field, goal));
  std::vector<Contender> contenders{Timed(GreedyMesher())};
  const std::string& peer = environment.options().peer;
  if (!peer.empty()) contenders.push_back(PeerContender(peer));
  const std::vector<Score> scores = Race(PointersTo(fields), goal, environment.options().runs, contenders);
  return {scores[0], peer.empty() ? std::optional<Score>() : scores[1]};
}

}  // namespace

Table MeasureTiles(Environment& environment) {
  Table table("T1", "T1: Delaunay, tiles of 257 x 257 samples", SpeedColumns());
  const std::array<const char*, 3> aims = {"4x (6x)", "5x (8x)", "7x (10x)"};
  for (std::size_t i = 0; i < kErrors.size(); ++i) {
    Contest sum{{}, Score{}};
    std::size_t areas = 0;
    for (const Area& area : TileAreas()) {
      const std::string name = fmt::format("T1 {} {} m", area.name, kErrors[i]);
      if (!environment.Wants(name)) continue;
      const std::optional<std::vector<tin::HeightField>> tiles = ReadTiles(area);
      if (!tiles) continue;
      const Contest contest = Contend(environment, name, *tiles, {kErrors[i]});
      table.Add(SpeedRow(name, contest, ""));
      sum.ours += contest.ours;
      if (contest.theirs) *sum.theirs += *contest.theirs;
      ++areas;
    }
    if (areas < TileAreas().size()) continue;
    if (environment.options().peer.empty()) sum.theirs.reset();
    table.Add(SpeedRow(fmt::format("T1 all {} m", kErrors[i]), sum, aims[i]));
  }
  return table;
}

Table MeasureTilesEverywhere(Environment& environment) {
  Table table("T1-everywhere", "T1: Delaunay, tiles of elevation models of all kinds: the peer's time over ours",
              {"raster", "tiles", "1 m", "vertices", "5 m", "vertices ", "20 m", "vertices  "});
  std::array<double, kErrors.size()> logarithms{};
  std::size_t rasters = 0;
  for (const char* file : TileRasters()) {
    const std::string name = fmt::format("T1 everywhere {}", file);
    if (!environment.Wants(name)) continue;
    const std::optional<std::vector<tin::HeightField>> tiles = ReadQuarterTiles(file);
    if (!tiles) continue;
    std::vector<Cell> row{file, Count(tiles->size())};
    for (std::size_t i = 0; i < kErrors.size(); ++i) {
      const Contest contest = Contend(environment, name, *tiles, {kErrors[i]});
      const double ratio = contest.theirs ? contest.theirs->min_seconds / contest.ours.min_seconds : 1;
      logarithms[i] += std::log(ratio);
      row.insert(row.end(), {contest.theirs ? Ratio(ratio) : Cell(), Count(contest.ours.points)});
    }
    table.Add(std::move(row));
    ++rasters;
  }
  if (rasters == 0 || environment.options().peer.empty()) return table;
  std::vector<Cell> means{"geometric mean", Cell()},
      aims{"aim", Cell(), "4x (6x)", Cell(), "5x (8x)", Cell(), "7x (10x)"};
  for (const double logarithm : logarithms) {
    means.insert(means.end(), {Ratio(std::exp(logarithm / static_cast<double>(rasters))), Cell()});
  }
  table.Add(std::move(means));
  table.Add(std::move(aims));
  return table;
}

Table MeasureVertexGoals(Environment& environment) {
  std::vector<std::string> columns = SpeedColumns();
  columns.push_back("RMS m");
  Table table("T2", "T2: Delaunay, 1024 x 1024 samples to a number of vertices", columns);
  for (const auto& [name, file] : {std::pair{"west-us", "westUS.tif"}, {"ntc", "ntc.tif"}}) {
    for (const auto& [points, aim] : {std::pair{10486u, "8x (10x)"}, {52429u, "5x (8x)"}, {50000u, "5x (8x)"}}) {
      const std::string row = fmt::format("T2 {} {}", name, points);
      if (!environment.Wants(row)) continue;
      std::optional<tin::HeightField> field = ReadField(file);
      if (!field) continue;
      std::vector<tin::HeightField> fields;
      fields.push_back(*std::move(field));
      std::vector<Cell> cells = SpeedRow(row, Contend(environment, row, fields, {0, points}), aim);
      cells.push_back(Number(tin::MeasureError(fields[0], MeshOf(fields[0], {0, points})).rms, 4));
      table.Add(std::move(cells));
    }
  }
  return table;
}

}  // namespace terrace::bench
