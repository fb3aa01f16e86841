#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "engine/tin/greedy.h"
#include "tests/bench/cpu_clock.h"
#include "tests/bench/paper.h"
#include "tests/bench/paper_models.h"
#include "tests/bench/parallel_insertion.h"

namespace terrace::bench {
namespace {

struct Timing {
  double n, m, seconds;
};

// The minimum of `repeats` runs of the seconds to each number of vertices.
std::vector<Timing> TimeRun(const tin::HeightField& field, const std::vector<std::size_t>& counts) {
  constexpr int kRepeats = 3;
  const double n = static_cast<double>(field.width()) * static_cast<double>(field.height());
  std::vector<Timing> timings;
  for (int repeat = 0; repeat < kRepeats; ++repeat) {
    double seconds = 0;
    std::optional<tin::GreedyTriangulation> tin;
    seconds += SecondsOf([&] { tin.emplace(field); });
    for (std::size_t i = 0; i < counts.size(); ++i) {
      seconds += SecondsOf([&] { tin->Run({0, counts[i]}); });
      if (repeat == 0) timings.push_back({n, static_cast<double>(counts[i]), seconds});
      timings[i].seconds = std::min(timings[i].seconds, seconds);
    }
  }
  return timings;
}

// One run of the naive algorithm.
Series TimeNaive(const tin::HeightField& field, const std::vector<std::size_t>& counts) {
  Series series{fmt::format("naive, n = {} x {}", field.width(), field.height()), {}};
  ParallelInsertion insertion(field);
  double seconds = 0;
  for (const std::size_t count : counts) {
    seconds += SecondsOf([&] {
      while (insertion.vertex_count() < count && insertion.NaivePass(count) > 0) {
      }
    });
    series.points.emplace_back(insertion.vertex_count(), seconds);
  }
  return series;
}

// The paper's cost, O((m + n) log m), as time = a n log2 m + b m log2 m: least squares of the relative errors.
struct Fit {
  double a = 0, b = 0;
  double At(double n, double m) const { return (a * n + b * m) * std::log2(m); }
};

Fit FitCost(const std::vector<Timing>& timings) {
  double uu = 0, uv = 0, vv = 0, u1 = 0, v1 = 0;
  for (const Timing& t : timings) {
    const double u = t.n * std::log2(t.m) / t.seconds, v = t.m * std::log2(t.m) / t.seconds;
    uu += u * u;
    uv += u * v;
    vv += v * v;
    u1 += u;
    v1 += v;
  }
  const double determinant = uu * vv - uv * uv;
  return {(u1 * vv - v1 * uv) / determinant, (v1 * uu - u1 * uv) / determinant};
}

}  // namespace

void TimeOverVertices(Results& results) {
  Figure figure{"time", "West US: CPU time of greedy insertion (figure 3)", "vertices", "seconds", {}};
  std::vector<Timing> all;
  Series naive;
  for (const int side : {128, 256, 512, 1024}) {
    const tin::HeightField field = Model("westUS.tif", {0, 0, side, side});
    std::vector<std::size_t> counts;
    for (std::size_t count = 100; count <= static_cast<std::size_t>(side) * static_cast<std::size_t>(side) / 5;
         count *= 2) {
      counts.push_back(count);
    }
    Series series{fmt::format("n = {} x {}", side, side), {}};
    for (const Timing& timing : TimeRun(field, counts)) {
      all.push_back(timing);
      series.points.emplace_back(timing.m, timing.seconds);
    }
    figure.series.push_back(std::move(series));
    if (side == 128) naive = TimeNaive(field, counts);
  }
  figure.series.push_back(std::move(naive));
  const Fit fit = FitCost(all);
  double worst = 1;
  for (const Timing& t : all) {
    const double ratio = fit.At(t.n, t.m) / t.seconds;
    worst = std::max({worst, ratio, 1 / ratio});
  }
  Table table("time", "time = a n log2 m + b m log2 m, fitted to all points",
              {"a, ns", "b, ns", "furthest point", "West US at 50,000 vertices, s"});
  table.Add({Number(fit.a * 1e9, 3), Number(fit.b * 1e9, 3), Ratio(worst), Number(fit.At(1024.0 * 1024, 50000), 3)});
  results.figures.push_back(std::move(figure));
  results.tables.push_back(std::move(table));
}

}  // namespace terrace::bench
