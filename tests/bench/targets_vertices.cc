#include <optional>
#include <utility>

#include "tests/bench/greedy_runs.h"
#include "tests/bench/parallel_insertion.h"
#include "tests/bench/rasters.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

// Number of vertices of exact greedy insertion: each pass inserts the worst of all samples, found with a plain scan.
// Samples with equal errors are inserted together.
std::size_t ExactGreedyPoints(const tin::HeightField& field, double error) {
  ParallelInsertion insertion(field);
  while (insertion.CurrentError() > error) insertion.FractionalPass(1, static_cast<std::size_t>(-1));
  return insertion.vertex_count();
}

void AddRow(Table& table, const std::string& name, std::size_t exact, std::size_t ours, const Cell& blocks) {
  table.Add({name, Count(exact), Count(ours), Percent(static_cast<double>(ours) / static_cast<double>(exact) - 1),
             "at most +1 % (equal)", blocks});
}

}  // namespace

Table MeasureVertices(Environment& environment) {
  Table table("T8", "T8: vertices at the same bound, beside one exact greedy run",
              {"case", "exact greedy", "ours", "more", "aim", "blocks"});
  for (const Area& area : TileAreas()) {
    constexpr double kError = 20;
    const std::string name = fmt::format("T8 {} tiles {} m", area.name, kError);
    if (!environment.Wants(name)) continue;
    const std::optional<std::vector<tin::HeightField>> tiles = ReadTiles(area);
    if (!tiles) continue;
    std::size_t exact = 0, ours = 0;
    for (const tin::HeightField& tile : *tiles) {
      exact += ExactGreedyPoints(tile, kError);
      ours += MeshOf(tile, {kError}).vertices.size();
    }
    AddRow(table, name, exact, ours, {});
  }
  for (const LargeRaster& raster : LargeRasters()) {
    for (const double error : {1.0, 5.0, 20.0}) {
      const std::string name = fmt::format("T8 {} {} m", raster.name, error);
      if (!environment.Wants(name)) continue;
      const std::optional<tin::HeightField> field = ReadLarge(raster);
      if (!field) continue;
      AddRow(table, name, MeshOf(*field, {error}).vertices.size(), MeshInBlocks(*field, {error}).vertices.size(),
             Count(tin::FieldPartition::For(*field, error).size()));
    }
  }
  return table;
}

}  // namespace terrace::bench
