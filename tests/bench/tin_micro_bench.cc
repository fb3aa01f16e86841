// Measures steps of the mesher with Google Benchmark, on tiles of a raster of the repository, to show which step a
// change affects. The targets are measured by terrace_tin_bench.
#include <benchmark/benchmark.h>

#include <array>
#include <optional>
#include <utility>
#include <vector>

#include "engine/core/check.h"
#include "engine/tin/greedy.h"
#include "engine/tin/mesh_error.h"
#include "tests/bench/rasters.h"

namespace terrace::bench {
namespace {

// Four different tiles, because a single one would train the processor's branch predictor.
const std::vector<tin::HeightField>& Tiles() {
  static const std::vector<tin::HeightField> tiles = [] {
    std::vector<tin::HeightField> read;
    for (const auto& [x, y] : {std::pair{0, 0}, {146, 0}, {0, 87}, {146, 87}}) {
      std::optional<tin::HeightField> field = ReadField("jacksboro.tif", {x, y, 257, 257});
      TERRACE_CHECK(field.has_value());
      read.push_back(*std::move(field));
    }
    return read;
  }();
  return tiles;
}

tin::TinMesh MeshOf(const tin::HeightField& field, double error) {
  tin::GreedyTriangulation tin(field);
  tin.Run({error});
  return tin.Mesh();
}

void Errors(benchmark::internal::Benchmark* benchmark) { benchmark->Arg(20)->Arg(5)->Arg(1); }

void Refine(benchmark::State& state) {
  const auto error = static_cast<double>(state.range(0));
  for (const tin::HeightField& tile : Tiles()) {
    TERRACE_CHECK(tin::MeasureError(tile, MeshOf(tile, error)).max <= error + 1e-9);
  }
  std::size_t turn = 0, vertices = 0;
  for (auto unused : state) vertices += MeshOf(Tiles()[turn++ % Tiles().size()], error).vertices.size();
  state.SetItemsProcessed(static_cast<std::int64_t>(vertices));
}
BENCHMARK(Refine)->Apply(Errors)->Unit(benchmark::kMillisecond);

void StartRefinement(benchmark::State& state) {
  std::size_t turn = 0;
  for (auto unused : state) {
    const tin::GreedyTriangulation tin(Tiles()[turn++ % Tiles().size()]);
    benchmark::DoNotOptimize(tin.CurrentError());
  }
}
BENCHMARK(StartRefinement)->Unit(benchmark::kMicrosecond);

void MeasureError(benchmark::State& state) {
  std::vector<tin::TinMesh> meshes;
  for (const tin::HeightField& tile : Tiles()) meshes.push_back(MeshOf(tile, static_cast<double>(state.range(0))));
  std::size_t turn = 0;
  for (auto unused : state) {
    const std::size_t i = turn++ % meshes.size();
    benchmark::DoNotOptimize(tin::MeasureError(Tiles()[i], meshes[i]));
  }
}
BENCHMARK(MeasureError)->Apply(Errors)->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace terrace::bench

BENCHMARK_MAIN();
