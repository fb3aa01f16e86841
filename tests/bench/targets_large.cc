#include <array>
#include <optional>
#include <utility>

#include "tests/bench/greedy_runs.h"
#include "tests/bench/rasters.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

// The target applies to rasters from this size on; smaller ones are for comparison.
constexpr int kTargetSide = 2401;

}  // namespace

Table MeasureLargeRasters(Environment& environment) {
  constexpr double kError = 5;
  std::vector<std::string> columns = SpeedColumns();
  columns.insert(columns.end(), {"blocks", "whole ms", "peer over whole"});
  Table table("T3", "T3: Delaunay, large rasters at an error, in blocks on one thread", columns);
  for (const LargeRaster& raster : LargeRasters()) {
    const std::string name = fmt::format("T3 {} {} m", raster.name, kError);
    if (!environment.Wants(name)) continue;
    const std::optional<tin::HeightField> field = ReadLarge(raster);
    if (!field) continue;
    const tin::GreedyGoal goal{kError};
    CheckMesh(name, *field, goal, MeshInBlocks(*field, goal));
    std::vector<Contender> contenders{Timed(MeshInBlocks), Timed(GreedyMesher())};
    const std::string& peer = environment.options().peer;
    if (!peer.empty()) contenders.push_back(PeerContender(peer));
    const std::vector<Score> scores = Race(std::array{&*field}, goal, environment.options().runs, contenders);
    std::vector<Cell> row = SpeedRow(name, {scores[0], peer.empty() ? std::optional<Score>() : scores[2]},
                                     field->width() < kTargetSide ? "" : "9x (15x)");
    row.push_back(Count(tin::FieldPartition::For(*field, kError).size()));
    row.push_back(Milliseconds(scores[1].min_seconds));
    row.push_back(peer.empty() ? Cell() : Ratio(scores[2].min_seconds / scores[1].min_seconds));
    table.Add(std::move(row));
  }
  return table;
}

}  // namespace terrace::bench
