#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <optional>
#include <string>

#include "engine/tin/greedy.h"
#include "engine/tin/mesh_error.h"
#include "tests/bench/environment.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/paper.h"
#include "tests/bench/paper_models.h"
#include "tests/bench/paper_reference.h"

namespace terrace::bench {
namespace {

struct Variant {
  const char* name;
  tin::GreedyOptions options;
  double reference::CraterRow::*scape;
};

std::array<Variant, 6> Variants() {
  using reference::CraterRow;
  return {{{"Delaunay", {}, &CraterRow::delaunay_rms},
           {"sum-max", DataDependent(), &CraterRow::sum_max_rms},
           {"sum of squares", DataDependent(tin::FitMeasure::kSumSquares), &CraterRow::sum_of_squares_rms},
           {"max-max", DataDependent(tin::FitMeasure::kMaxMax), &CraterRow::max_max_rms},
           {"normals", DataDependent(tin::FitMeasure::kNormals), &CraterRow::normals_rms},
           {"sum-max, q = 0", DataDependent(tin::FitMeasure::kSumMax, 0), &CraterRow::pure_sum_max_rms}}};
}

// All measures of section 3.4.1.
Table Measures(const tin::HeightField& crater) {
  std::vector<std::string> columns{"m"};
  std::vector<std::vector<Cell>> rows;
  for (const reference::CraterRow& row : reference::kCrater) rows.push_back({Count(row.points)});
  for (const Variant& variant : Variants()) {
    columns.emplace_back(variant.name);
    tin::GreedyTriangulation tin(crater, variant.options);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      tin.Run({0, reference::kCrater[i].points});
      const double rms = tin::MeasureError(crater, tin.Mesh()).rms;
      rows[i].emplace_back(fmt::format("{:.5g} [{:.5g}]", rms, reference::kCrater[i].*variant.scape), rms);
    }
  }
  Table table("crater-data-dependent", "Crater: RMS error in m at m vertices, Scape's in brackets", columns);
  for (std::vector<Cell>& row : rows) table.Add(std::move(row));
  return table;
}

// Compares the bound that the run reports with the error that an independent pass measures.
Table Maxima(const tin::HeightField& crater) {
  Table table("crater-maxima", "Crater: maximum error in m at m vertices, data-dependent (sum-max)",
              {"m", "reported", "measured", "Scape's, measured"});
  tin::GreedyTriangulation tin(crater, DataDependent());
  for (const reference::CraterRow& row : reference::kCrater) {
    tin.Run({0, row.points});
    table.Add({Count(row.points), Number(tin.CurrentError(), 4), Number(tin::MeasureError(crater, tin.Mesh()).max, 4),
               Number(row.sum_max_max, 4)});
  }
  return table;
}

// Seconds to each number of vertices, the minimum of some runs, and the RMS error there.
Series ErrorOverTime(const tin::HeightField& field, const std::string& name, const tin::GreedyOptions& options) {
  constexpr int kRepeats = 3;
  Series series{name, {}};
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    std::optional<tin::GreedyTriangulation> tin;
    double seconds = SecondsOf([&] { tin.emplace(field, options); });
    std::size_t i = 0;
    for (const std::size_t points : VertexCounts(field)) {
      seconds += SecondsOf([&] { tin->Run({0, points}); });
      if (repeat == 0) series.points.emplace_back(seconds, tin::MeasureError(field, tin->Mesh()).rms);
      series.points[i].first = std::min(series.points[i].first, seconds);
      ++i;
    }
  }
  return series;
}

}  // namespace

void DataDependentQuality(Results& results) {
  const tin::HeightField crater = Model("crater.tif");
  results.tables.push_back(Measures(crater));
  results.tables.push_back(Maxima(crater));
  Series delaunay{"Scape, Delaunay", {}, true}, data_dependent{"Scape, data-dependent", {}, true};
  for (const reference::CraterRow& row : reference::kCrater) {
    delaunay.points.emplace_back(row.points, row.delaunay_rms);
    data_dependent.points.emplace_back(row.points, row.sum_max_rms);
  }
  results.figures.push_back(
      {"data-dependent",
       "Crater: Delaunay and data-dependent (figure 13)",
       "vertices",
       "RMS error, m",
       {GreedyCurve(crater, kDelaunayName, {}), GreedyCurve(crater, kDataDependentName, DataDependent()),
        std::move(delaunay), std::move(data_dependent)}});
  results.figures.push_back(
      {"time-error",
       "Crater: error over time (figure 14)",
       "seconds",
       "RMS error, m",
       {ErrorOverTime(crater, kDelaunayName, {}), ErrorOverTime(crater, kDataDependentName, DataDependent())}});
}

}  // namespace terrace::bench
