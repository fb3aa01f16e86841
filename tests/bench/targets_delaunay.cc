#include <array>
#include <optional>
#include <utility>

#include "tests/bench/greedy_runs.h"
#include "tests/bench/rasters.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

constexpr std::array<double, 3> kErrors = {1, 5, 20};

Contest Contend(Environment& environment, const std::string& name, const std::vector<tin::HeightField>& fields,
                const tin::GreedyGoal& goal) {
  Contest contest;
  for (const tin::HeightField& field : fields) {
    const double rms = CheckMesh(name, field, goal, MeshOf(field, goal));
    if (goal.max_error == 0) contest.rms = rms;
  }
  std::vector<Contender> contenders{MeshFromScratch};
  const std::string& peer = environment.options().peer;
  if (!peer.empty()) contenders.push_back(PeerContender(peer));
  const std::vector<Score> scores = Race(PointersTo(fields), goal, environment.options().runs, contenders);
  contest.ours = scores[0];
  if (scores.size() > 1) contest.theirs = scores[1];
  return contest;
}

}  // namespace

Table MeasureTiles(Environment& environment) {
  Table table("T1", "T1: Delaunay, tiles of 257 x 257 samples", SpeedColumns());
  const std::array<const char*, 3> aims = {"4x (6x)", "5x (8x)", "7x (10x)"};
  for (std::size_t i = 0; i < kErrors.size(); ++i) {
    Contest sum{{}, Score{}, {}};
    std::size_t areas = 0;
    for (const Area& area : TileAreas()) {
      const std::string name = fmt::format("T1 {} {} m", area.name, kErrors[i]);
      if (!environment.Wants(name)) continue;
      const std::optional<std::vector<tin::HeightField>> tiles = ReadTiles(area);
      if (!tiles) continue;
      const Contest contest = Contend(environment, name, *tiles, {kErrors[i]});
      AddRow(table, name, contest, "");
      sum.ours += contest.ours;
      if (contest.theirs) *sum.theirs += *contest.theirs;
      ++areas;
    }
    if (areas < TileAreas().size()) continue;
    if (environment.options().peer.empty()) sum.theirs.reset();
    AddRow(table, fmt::format("T1 all {} m", kErrors[i]), sum, aims[i]);
  }
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
      AddRow(table, row, Contend(environment, row, fields, {0, points}), aim);
    }
  }
  return table;
}

Table MeasureLargeRasters(Environment& environment) {
  Table table("T3", "T3: Delaunay, large rasters at an error", SpeedColumns());
  struct Case {
    const char* name;
    const char* file;
    Window window;
    bool mirrored;
    const char* aim;
  };
  const std::array<Case, 4> cases = {{
      {"jacksboro 403x344", "jacksboro.tif", {}, false, ""},  // the one without test data
      {"andes mirrored 2401x2401", "srtm3_S33W071_andes.tif", {}, true, "9x (15x)"},
      {"maui 2401x2401", "srtm1_N20W157_maui_se_haleakala.tif", {1200, 0, 2401, 2401}, false, "9x (15x)"},
      {"maui 3601x3601", "srtm1_N20W157_maui_se_haleakala.tif", {}, false, "9x (15x)"},
  }};
  for (const Case& c : cases) {
    const std::string row = fmt::format("T3 {} 5 m", c.name);
    if (!environment.Wants(row)) continue;
    std::optional<tin::HeightField> field = ReadField(c.file, c.window);
    if (!field) continue;
    std::vector<tin::HeightField> fields;
    fields.push_back(c.mirrored ? MirroredFourfold(*field) : *std::move(field));
    AddRow(table, row, Contend(environment, row, fields, {5}), c.aim);
  }
  return table;
}

}  // namespace terrace::bench
