#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh_error.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/paper.h"
#include "tests/bench/paper_models.h"
#include "tests/bench/paper_reference.h"
#include "tests/bench/parallel_insertion.h"
#include "tests/bench/rasters.h"
#include "tests/bench/uniform_grid.h"

namespace terrace::bench {
namespace {

Series UniformCurve(const tin::HeightField& field) {
  Series series{"uniform grid", {}};
  for (const std::size_t points : VertexCounts(field)) {
    const tin::TinMesh mesh = UniformGridOf(field, points);
    series.points.emplace_back(mesh.vertices.size(), tin::MeasureError(field, mesh).rms);
  }
  return series;
}

// Adds Scape's known meshes.
void AddScapeMarks(const std::string& id, Figure& figure) {
  Series delaunay{"Scape, Delaunay", {}, true}, data_dependent{"Scape, data-dependent", {}, true};
  if (id == "crater") {
    for (const reference::CraterRow& row : reference::kCrater) {
      delaunay.points.emplace_back(row.points, row.delaunay_rms);
      data_dependent.points.emplace_back(row.points, row.sum_max_rms);
    }
  } else if (id == "ashby") {
    for (const reference::AshbyRow& row : reference::kAshby) {
      delaunay.points.emplace_back(row.points, row.delaunay_rms);
      data_dependent.points.emplace_back(row.points, row.data_dependent_rms);
    }
  } else {
    return;
  }
  figure.series.push_back(std::move(delaunay));
  figure.series.push_back(std::move(data_dependent));
}

std::string StrategyName(const reference::ParallelRow& row) {
  return row.epsilon < 0 ? fmt::format("alpha = {:g}", row.alpha) : fmt::format("epsilon = {:g} m", row.epsilon);
}

// Vertices and RMS after every pass.
Series ParallelCurve(const tin::HeightField& field, const reference::ParallelRow& row) {
  constexpr std::size_t kEnough = 10000, kNoLimit = static_cast<std::size_t>(-1);
  Series series{StrategyName(row), {}};
  ParallelInsertion insertion(field);
  while (insertion.vertex_count() < kEnough) {
    const std::size_t inserted =
        row.epsilon < 0 ? insertion.FractionalPass(row.alpha, kNoLimit) : insertion.ConstantPass(row.epsilon, kNoLimit);
    if (inserted == 0) break;
    series.points.emplace_back(insertion.vertex_count(), tin::MeasureError(field, insertion.Mesh()).rms);
  }
  return series;
}

// The curve's first point with that many vertices, which is the end of the pass that reached them.
std::optional<std::pair<double, double>> FirstWith(const Series& series, std::size_t points) {
  for (const auto& point : series.points) {
    if (point.first >= static_cast<double>(points)) return point;
  }
  return std::nullopt;
}

}  // namespace

void ParallelInsertions(Results& results) {
  const tin::HeightField crater = Model("crater.tif");
  Figure figure{"parallel", "Crater: one and many insertions per pass (figure 12)", "vertices", "RMS error, m", {}};
  Table table("parallel",
              "Crater: RMS error in m after the pass that reached m vertices (vertices), Scape's in brackets",
              {"strategy", "m = 1542", "m = 5000", "m = 7711"});
  figure.series.push_back(GreedyCurve(crater, "sequential", {}));
  std::erase_if(figure.series.back().points, [](const auto& point) { return point.first > 10000; });
  std::vector<Cell> sequential{"sequential"};
  tin::GreedyTriangulation tin(crater);
  for (const reference::CraterRow& row : reference::kCrater) {
    if (row.points != 1542 && row.points != 5000 && row.points != 7711) continue;
    tin.Run({0, row.points});
    const double rms = tin::MeasureError(crater, tin.Mesh()).rms;
    sequential.emplace_back(fmt::format("{:.3g} ({}) [{:.3g}]", rms, row.points, row.delaunay_rms), rms);
  }
  table.Add(std::move(sequential));
  for (const reference::ParallelRow& row : reference::kParallel) {
    Series curve = ParallelCurve(crater, row);
    std::vector<Cell> cells{curve.name};
    for (std::size_t i = 0; i < reference::kParallelPoints.size(); ++i) {
      const auto point = FirstWith(curve, reference::kParallelPoints[i]);
      const double theirs = row.rms[i];
      cells.emplace_back((point ? fmt::format("{:.3g} ({:.0f})", point->second, point->first) : std::string("-")) +
                         (theirs > 0 ? fmt::format(" [{:.3g}]", theirs) : ""));
    }
    table.Add(std::move(cells));
    figure.series.push_back(std::move(curve));
  }
  results.figures.push_back(std::move(figure));
  results.tables.push_back(std::move(table));
}

void CraterQuality(Results& results) {
  const tin::HeightField crater = Model("crater.tif");
  Table table("crater", "Crater: RMS and maximum error in m at m vertices, beside Scape's",
              {"m", "RMS", "Scape's", "difference", "maximum", "Scape's maximum", "grid nodes", "uniform grid RMS",
               "Scape's grid"});
  tin::GreedyTriangulation tin(crater);
  for (const reference::CraterRow& row : reference::kCrater) {
    tin.Run({0, row.points});
    const tin::MeshError error = tin::MeasureError(crater, tin.Mesh());
    const tin::TinMesh grid = UniformGridOf(crater, row.points);
    table.Add({Count(row.points), Number(error.rms, 5), Number(row.delaunay_rms, 5),
               Percent(error.rms / row.delaunay_rms - 1), Number(error.max, 4), Number(row.delaunay_max, 4),
               Count(grid.vertices.size()), Number(tin::MeasureError(crater, grid).rms, 5),
               Number(row.uniform_rms, 5)});
  }
  results.tables.push_back(std::move(table));
}

void QualityOverVertices(Results& results) {
  const tin::HeightField ashby = Model("ashby.tif");
  Table table("ashby", "Ashby: RMS error in m at m vertices, Scape's in brackets (figure 15)",
              {"m", "Delaunay", "data-dependent", "uniform grid"});
  tin::GreedyTriangulation tin(ashby), data_dependent(ashby, DataDependent());
  for (const reference::AshbyRow& row : reference::kAshby) {
    tin.Run({0, row.points});
    const double rms = tin::MeasureError(ashby, tin.Mesh()).rms;
    data_dependent.Run({0, row.points});
    const double fitted = tin::MeasureError(ashby, data_dependent.Mesh()).rms;
    const double grid = tin::MeasureError(ashby, UniformGridOf(ashby, row.points)).rms;
    table.Add({Count(row.points),
               {fmt::format("{:.4g} [{:.4g}]", rms, row.delaunay_rms), rms},
               {fmt::format("{:.4g} [{:.4g}]", fitted, row.data_dependent_rms), fitted},
               {fmt::format("{:.4g} [{:.4g}]", grid, row.uniform_rms), grid}});
  }
  results.tables.push_back(std::move(table));
  for (const auto& [id, title] : {std::pair{"ashby", "Ashby (figure 15)"},
                                  {"crater", "Crater"},
                                  {"westUS", "West US"},
                                  {"ntc", "NTC"},
                                  {"ozark", "Ozark"}}) {
    const tin::HeightField field = Model(fmt::format("{}.tif", id));
    Figure figure{fmt::format("quality-{}", id),
                  fmt::format("{}: greedy insertion and uniform grids", title),
                  "vertices",
                  "RMS error, m",
                  {GreedyCurve(field, kDelaunayName, {}), GreedyCurve(field, kDataDependentName, DataDependent()),
                   UniformCurve(field)}};
    AddScapeMarks(id, figure);
    results.figures.push_back(std::move(figure));
  }
}

}  // namespace terrace::bench
