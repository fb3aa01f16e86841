#include <array>
#include <optional>
#include <utility>

#include "engine/tin/mesh_error.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/rasters.h"
#include "tests/bench/targets.h"

namespace terrace::bench {
namespace {

struct Comparison {
  Score ours, delaunay;
  std::optional<Score> theirs;

  Comparison& operator+=(const Comparison& other) {
    ours += other.ours;
    delaunay += other.delaunay;
    if (theirs && other.theirs) *theirs += *other.theirs;
    return *this;
  }
};

Comparison Compare(Environment& environment, const std::string& name, const std::vector<tin::HeightField>& fields,
                   const tin::GreedyGoal& goal) {
  for (const tin::HeightField& field : fields) CheckMesh(name, field, goal, MeshOf(field, goal, DataDependent()));
  std::vector<Contender> contenders{Timed(GreedyMesher(DataDependent())), Timed(GreedyMesher())};
  const std::string& peer = environment.options().data_dependent_peer;
  if (!peer.empty()) contenders.push_back(PeerContender(peer));
  const std::vector<Score> scores = Race(PointersTo(fields), goal, environment.options().runs, contenders);
  return {scores[0], scores[1], peer.empty() ? std::optional<Score>() : scores[2]};
}

double Share(std::size_t points, std::size_t others) {
  return static_cast<double>(points) / static_cast<double>(others) - 1;
}

std::vector<Cell> TimeCells(const std::string& name, const Comparison& c) {
  std::vector<Cell> row{name,
                        Milliseconds(c.ours.min_seconds),
                        Milliseconds(c.ours.median_seconds),
                        Milliseconds(c.delaunay.min_seconds),
                        Ratio(c.ours.min_seconds / c.delaunay.min_seconds),
                        "at most 2x (1.5x)"};
  if (c.theirs) {
    row.insert(row.end(), {Milliseconds(c.theirs->min_seconds), Ratio(c.theirs->min_seconds / c.ours.min_seconds)});
  } else {
    row.resize(row.size() + 2);
  }
  return row;
}

std::vector<std::string> Columns(std::vector<std::string> more) {
  std::vector<std::string> columns{"case",          "ours ms", "ours median", "Delaunay ms",
                                   "over Delaunay", "aim",     "peer ms",     "peer over ours"};
  columns.insert(columns.end(), more.begin(), more.end());
  return columns;
}

std::vector<Cell> ErrorRow(const std::string& name, const Comparison& c, const char* aim) {
  std::vector<Cell> row = TimeCells(name, c);
  row.insert(row.end(),
             {Count(c.ours.points), Count(c.delaunay.points), Percent(Share(c.ours.points, c.delaunay.points)), aim,
              c.theirs ? Count(c.theirs->points) : Cell()});
  return row;
}

}  // namespace

Table MeasureDataDependent(Environment& environment) {
  Table table("T5", "T5: data-dependent triangulation beside Delaunay, tiles of 257 x 257 samples at an error",
              Columns({"vertices", "Delaunay's", "fewer", "aim of vertices", "peer's"}));
  for (const double error : {1.0, 5.0, 20.0}) {
    Comparison sum;
    if (!environment.options().data_dependent_peer.empty()) sum.theirs = Score{};
    std::size_t areas = 0;
    for (const Area& area : TileAreas()) {
      const std::string name = fmt::format("T5 {} {} m", area.name, error);
      if (!environment.Wants(name)) continue;
      const std::optional<std::vector<tin::HeightField>> tiles = ReadTiles(area);
      if (!tiles) continue;
      const Comparison compared = Compare(environment, name, *tiles, {error});
      table.Add(ErrorRow(name, compared, ""));
      sum += compared;
      ++areas;
    }
    if (areas == TileAreas().size()) table.Add(ErrorRow(fmt::format("T5 all {} m", error), sum, "-12 % (-15 %)"));
  }
  return table;
}

Table MeasureDataDependentQuality(Environment& environment) {
  Table table("T5-rms", "T5: data-dependent triangulation beside Delaunay, to a number of vertices",
              Columns({"RMS m", "Delaunay's", "share", "aim of RMS"}));
  struct Case {
    const char *name, *file;
    std::array<std::size_t, 3> points;
  };
  for (const Case& c : {Case{"jacksboro", "jacksboro.tif", {1386, 6932, 50000}},
                        {"crater", "crater.tif", {1542, 7711, 50000}},
                        {"west-us", "westUS.tif", {10486, 52429, 200000}},
                        {"ntc", "ntc.tif", {10486, 52429, 200000}}}) {
    for (const std::size_t points : c.points) {
      const std::string name = fmt::format("T5 {} {}", c.name, points);
      if (!environment.Wants(name)) continue;
      std::optional<tin::HeightField> field = ReadField(c.file);
      if (!field) continue;
      std::vector<tin::HeightField> fields;
      fields.push_back(*std::move(field));
      const tin::GreedyGoal goal{0, points};
      std::vector<Cell> row = TimeCells(name, Compare(environment, name, fields, goal));
      const double ours = tin::MeasureError(fields[0], MeshOf(fields[0], goal, DataDependent())).rms;
      const double delaunay = tin::MeasureError(fields[0], MeshOf(fields[0], goal)).rms;
      row.insert(row.end(), {Number(ours, 4), Number(delaunay, 4), Number(ours / delaunay, 3), ".88 (.85)"});
      table.Add(std::move(row));
    }
  }
  return table;
}

}  // namespace terrace::bench
