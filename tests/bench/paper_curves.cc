#include <fmt/format.h>

#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh_error.h"
#include "tests/bench/environment.h"
#include "tests/bench/paper.h"
#include "tests/bench/paper_reference.h"
#include "tests/bench/parallel_insertion.h"
#include "tests/bench/rasters.h"
#include "tests/bench/uniform_grid.h"

namespace terrace::bench {
namespace {

tin::HeightField Model(const std::string& file) {
  std::optional<tin::HeightField> field = ReadField(file);
  if (!field) Die("the paper's elevation models are needed; set TERRACE_TEST_DATA");
  return *std::move(field);
}

// 1, 2, 5, 10, ... times 100, up to a third of the samples: the axis of the curves.
std::vector<std::size_t> VertexCounts(const tin::HeightField& field) {
  const auto samples = static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height());
  std::vector<std::size_t> counts;
  for (std::size_t decade = 100; decade <= samples / 3; decade *= 10) {
    for (const std::size_t step : {1, 2, 5}) {
      if (decade * step <= samples / 3) counts.push_back(decade * step);
    }
  }
  return counts;
}

Series GreedyCurve(const tin::HeightField& field) {
  Series series{"greedy, Delaunay", {}};
  tin::GreedyTriangulation tin(field);
  for (const std::size_t points : VertexCounts(field)) {
    tin.Run({0, points});
    series.points.emplace_back(points, tin::MeasureError(field, tin.Mesh()).rms);
  }
  return series;
}

Series UniformCurve(const tin::HeightField& field) {
  Series series{"uniform grid", {}};
  for (const std::size_t points : VertexCounts(field)) {
    const tin::TinMesh mesh = UniformGridOf(field, points);
    series.points.emplace_back(mesh.vertices.size(), tin::MeasureError(field, mesh).rms);
  }
  return series;
}

// Scape's Delaunay meshes, where they are known.
std::optional<Series> ScapeMarks(const std::string& id) {
  Series marks{"Scape, Delaunay", {}, true};
  if (id == "crater") {
    for (const reference::CraterRow& row : reference::kCrater) marks.points.emplace_back(row.points, row.delaunay_rms);
  } else if (id == "ashby") {
    for (const reference::AshbyRow& row : reference::kAshby) marks.points.emplace_back(row.points, row.delaunay_rms);
  } else {
    return std::nullopt;
  }
  return marks;
}

std::string StrategyName(const reference::ParallelRow& row) {
  return row.epsilon < 0 ? fmt::format("alpha = {:g}", row.alpha) : fmt::format("epsilon = {:g} m", row.epsilon);
}

// After every pass: vertices and RMS.
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

// The curve's first point with that many vertices: where the pass ended that reached them.
std::optional<std::pair<double, double>> FirstWith(const Series& series, std::size_t points) {
  for (const auto& point : series.points) {
    if (point.first >= static_cast<double>(points)) return point;
  }
  return std::nullopt;
}

}  // namespace

void ParallelInsertions(Findings& findings) {
  const tin::HeightField crater = Model("crater.tif");
  Figure figure{"parallel", "Crater: one and many insertions per pass (figure 12)", "vertices", "RMS error, m", {}};
  Table table("parallel",
              "Crater: RMS error in m after the pass that reached m vertices (vertices), Scape's in brackets",
              {"strategy", "m = 1542", "m = 5000", "m = 7711"});
  figure.series.push_back(GreedyCurve(crater));
  figure.series.back().name = "sequential";
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
  findings.figures.push_back(std::move(figure));
  findings.tables.push_back(std::move(table));
}

void CraterQuality(Findings& findings) {
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
  findings.tables.push_back(std::move(table));
}

void QualityOverVertices(Findings& findings) {
  const tin::HeightField ashby = Model("ashby.tif");
  Table table("ashby", "Ashby: RMS error in m at m vertices, Scape's in brackets (figure 15)",
              {"m", "Delaunay", "uniform grid"});
  tin::GreedyTriangulation tin(ashby);
  for (const reference::AshbyRow& row : reference::kAshby) {
    tin.Run({0, row.points});
    const double rms = tin::MeasureError(ashby, tin.Mesh()).rms;
    const double grid = tin::MeasureError(ashby, UniformGridOf(ashby, row.points)).rms;
    table.Add({Count(row.points),
               {fmt::format("{:.4g} [{:.4g}]", rms, row.delaunay_rms), rms},
               {fmt::format("{:.4g} [{:.4g}]", grid, row.uniform_rms), grid}});
  }
  findings.tables.push_back(std::move(table));
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
                  {GreedyCurve(field), UniformCurve(field)}};
    if (std::optional<Series> marks = ScapeMarks(id)) figure.series.push_back(*std::move(marks));
    findings.figures.push_back(std::move(figure));
  }
}

}  // namespace terrace::bench
