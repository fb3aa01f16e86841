#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/tin/refinement.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/rasters.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

constexpr double kFinestError = 1;
constexpr std::array<double, 4> kReplayed = {2, 4, 8, 24};
// Ten consecutive errors of a tile, a quarter of an octave apart: steps of geo::LadderError from the finest one.
constexpr int kLadderSteps = 10;
double LadderError(int step) { return kFinestError * std::exp2(step / 4.0); }

tin::Refinement RefinementTo(const tin::HeightField& field, double error, tin::GreedyOptions options = {}) {
  options.record = true;
  tin::GreedyTriangulation tin(field, options);
  tin.Run({error});
  return tin.MakeRefinement().value();
}

// One refinement for each field, as in a cache. `fields` must outlive it.
class RecordedFields {
 public:
  explicit RecordedFields(const std::vector<tin::HeightField>& fields) {
    for (const tin::HeightField& field : fields) recorded_.emplace_back(&field, RefinementTo(field, kFinestError));
  }

  const tin::Refinement& Of(const tin::HeightField& field) const {
    for (const auto& [recorded, refinement] : recorded_) {
      if (recorded == &field) return refinement;
    }
    Die("a field without a refinement");
  }

  // Stored bytes per vertex, over all refinements.
  double SerializedBytesPerVertex() const {
    double bytes = 0, vertices = 0;
    for (const auto& [field, refinement] : recorded_) {
      bytes += static_cast<double>(refinement.Serialize().size());
      vertices += static_cast<double>(refinement.vertex_count());
    }
    return bytes / vertices;
  }

 private:
  std::vector<std::pair<const tin::HeightField*, tin::Refinement>> recorded_;
};

void CheckReplay(const std::string& name, const tin::HeightField& field, const tin::Refinement& refinement,
                 double error) {
  const tin::TinMesh replayed = refinement.MeshAt(error);
  CheckMesh(name, field, {error}, replayed);
  if (replayed.vertices != MeshOf(field, {error}).vertices) Die(name + ": the replay has other vertices than the run");
}

std::vector<Cell> RowOf(const std::string& name, const std::vector<Score>& scores, const char* aim) {
  const Score &replay = scores[0], &scratch = scores[1];
  return {name,
          Milliseconds(replay.min_seconds),
          Milliseconds(replay.median_seconds),
          Milliseconds(scratch.min_seconds),
          Milliseconds(scratch.median_seconds),
          Ratio(scratch.min_seconds / replay.min_seconds),
          aim,
          Count(replay.points),
          Number(replay.min_seconds / static_cast<double>(replay.points) * 1e9, 3)};
}

// One recorded run to the finest error and a replay to each of the ten.
Contender Sweep(const tin::GreedyOptions& options) {
  return [options](const tin::HeightField& field, const tin::GreedyGoal& goal, Runs& runs) {
    runs.seconds.push_back(SecondsOf([&] {
      const tin::Refinement refinement = RefinementTo(field, goal.max_error, options);
      for (int step = 0; step < kLadderSteps; ++step) {
        runs.points = refinement.MeshAt(LadderError(step)).vertices.size();
      }
    }));
  };
}

}  // namespace

Table MeasureReplay(Environment& environment) {
  Table table("T4", "T4: a further threshold of a tile that was refined to 1 m, replayed and from scratch",
              {"case", "replay ms", "replay median", "scratch ms", "scratch median", "ratio", "aim", "vertices",
               "ns a vertex", "stored bytes a vertex"});
  for (const Area& area : TileAreas()) {
    const auto name_of = [&](double error) { return fmt::format("T4 {} {} m", area.name, error); };
    if (std::none_of(kReplayed.begin(), kReplayed.end(), [&](double e) { return environment.Wants(name_of(e)); })) {
      continue;
    }
    const std::optional<std::vector<tin::HeightField>> tiles = ReadTiles(area);
    if (!tiles) continue;
    const RecordedFields recorded(*tiles);
    const Contender replay = [&](const tin::HeightField& field, const tin::GreedyGoal& goal, Runs& runs) {
      const tin::Refinement& refinement = recorded.Of(field);
      runs.seconds.push_back(SecondsOf([&] { runs.points = refinement.MeshAt(goal.max_error).vertices.size(); }));
    };
    for (const double error : kReplayed) {
      const std::string name = name_of(error);
      if (!environment.Wants(name)) continue;
      for (const tin::HeightField& tile : *tiles) CheckReplay(name, tile, recorded.Of(tile), error);
      std::vector<Cell> row = RowOf(name,
                                    Race(PointersTo(*tiles), {error}, environment.options().runs,
                                         std::array<Contender, 2>{replay, Timed(GreedyMesher())}),
                                    "8x (14x)");
      row.push_back(Number(recorded.SerializedBytesPerVertex(), 3));
      table.Add(std::move(row));
    }
  }
  return table;
}

Table MeasureSweep(Environment& environment) {
  Table table("T4-sweep", "T4: ten thresholds of a tile, 1 m to 4.8 m: one recorded run and ten replays",
              {"case", "sweep ms", "sweep median", "1 m alone ms", "1 m median", "sweep over 1 m alone", "aim"});
  for (const Area& area : TileAreas()) {
    for (const auto& [criterion, options] :
         {std::pair{"Delaunay", tin::GreedyOptions{}}, {"data-dependent", DataDependent()}}) {
      const std::string name = fmt::format("T4 {} sweep {}", area.name, criterion);
      if (!environment.Wants(name)) continue;
      const std::optional<std::vector<tin::HeightField>> tiles = ReadTiles(area);
      if (!tiles) continue;
      const std::array<Contender, 2> contenders{Sweep(options), Timed(GreedyMesher(options))};
      const std::vector<Score> scores =
          Race(PointersTo(*tiles), {kFinestError}, environment.options().runs, contenders);
      table.Add({name, Milliseconds(scores[0].min_seconds), Milliseconds(scores[0].median_seconds),
                 Milliseconds(scores[1].min_seconds), Milliseconds(scores[1].median_seconds),
                 Ratio(scores[0].min_seconds / scores[1].min_seconds), "at most 1.5x"});
    }
  }
  return table;
}

}  // namespace terrace::bench
