#include <fmt/format.h>

#include <array>

#include "engine/tin/greedy.h"
#include "tests/bench/environment.h"
#include "tests/bench/greedy_runs.h"
#include "tests/bench/paper.h"
#include "tests/bench/paper_models.h"
#include "tests/bench/pictures.h"

namespace terrace::bench {
namespace {

void Write(const Picture& picture, const std::string& path) {
  if (const auto written = WritePng(picture, path); !written) Die(written.error().message);
}

std::size_t PercentOf(const tin::HeightField& field, std::size_t percent) {
  return static_cast<std::size_t>(field.width()) * static_cast<std::size_t>(field.height()) * percent / 100;
}

}  // namespace

void DrawPictures(const std::string& folder) {
  const tin::HeightField crater = Model("crater.tif");
  constexpr double kCraterSpacing = 30;
  Write(Hillshade(crater, kCraterSpacing), folder + "/crater.png");
  tin::GreedyTriangulation tin(crater);
  for (const std::size_t percent : {1u, 5u}) {
    tin.Run({0, PercentOf(crater, percent)});
    const tin::TinMesh mesh = tin.Mesh();
    Write(Hillshade(SampledMesh(crater, mesh), kCraterSpacing), fmt::format("{}/crater-{}.png", folder, percent));
    Write(Wireframe(crater, mesh, 2), fmt::format("{}/crater-{}-mesh.png", folder, percent));
  }
  const tin::TinMesh fitted = MeshOf(crater, {0, PercentOf(crater, 1)}, DataDependent());
  Write(Hillshade(SampledMesh(crater, fitted), kCraterSpacing), folder + "/crater-1-data-dependent.png");
  Write(Wireframe(crater, fitted, 2), folder + "/crater-1-data-dependent-mesh.png");

  const tin::HeightField area = Model("westUS.tif", {500, 200, 257, 257});
  constexpr double kWestUsSpacing = 90;
  Write(Hillshade(area, kWestUsSpacing), folder + "/series-100.png");
  tin::GreedyTriangulation series(area);
  for (const std::size_t percent : {1u, 2u, 5u, 10u, 20u, 50u}) {
    series.Run({0, PercentOf(area, percent)});
    Write(Hillshade(SampledMesh(area, series.Mesh()), kWestUsSpacing),
          fmt::format("{}/series-{}.png", folder, percent));
  }
}

}  // namespace terrace::bench
