#include <array>
#include <optional>
#include <utility>

#include "engine/tin/decimate/drop_pass.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/rasters.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

tin::TinMesh DroppedMesh(const tin::HeightField& field, const tin::GreedyGoal& goal) {
  std::optional<tin::TinMesh> mesh = tin::DropVertices(field, MeshOf(field, goal), {.max_error = goal.max_error});
  if (!mesh) Die("the drop pass stopped by itself");
  return *std::move(mesh);
}

}  // namespace

Table MeasureDropPass(Environment& environment) {
  Table table("T6", "T6: greedy insertion and the drop pass, tiles of 257 x 257 samples",
              {"case", "ours ms", "ours median", "greedy alone ms", "peer ms", "ratio", "aim", "vertices",
               "greedy alone", "fewer", "aim of vertices"});
  struct Aim {
    double error;
    const char *time, *vertices;
  };
  for (const Aim& aim : {Aim{1, "", ""}, {5, "1x (2x)", "-30 % (-35 %)"}, {20, "", ""}}) {
    for (const Area& area : TileAreas()) {
      const std::string name = fmt::format("T6 {} {} m", area.name, aim.error);
      if (!environment.Wants(name)) continue;
      const std::optional<std::vector<tin::HeightField>> tiles = ReadTiles(area);
      if (!tiles) continue;
      const tin::GreedyGoal goal{aim.error};
      for (const tin::HeightField& tile : *tiles) CheckMesh(name, tile, goal, DroppedMesh(tile, goal));
      std::vector<Contender> contenders{Timed(DroppedMesh), Timed(GreedyMesher())};
      const std::string& peer = environment.options().peer;
      if (!peer.empty()) contenders.push_back(PeerContender(peer));
      const std::vector<Score> scores = Race(PointersTo(*tiles), goal, environment.options().runs, contenders);
      const Score &ours = scores[0], &greedy = scores[1];
      table.Add({name, Milliseconds(ours.min_seconds), Milliseconds(ours.median_seconds),
                 Milliseconds(greedy.min_seconds), peer.empty() ? Cell() : Milliseconds(scores[2].min_seconds),
                 peer.empty() ? Cell() : Ratio(scores[2].min_seconds / ours.min_seconds), aim.time, Count(ours.points),
                 Count(greedy.points),
                 Percent(static_cast<double>(ours.points) / static_cast<double>(greedy.points) - 1), aim.vertices});
    }
  }
  return table;
}

}  // namespace terrace::bench
