#include "tests/bench/paper_models.h"

#include <optional>
#include <utility>

#include "engine/tin/mesh_error.h"
#include "tests/bench/environment.h"

namespace terrace::bench {

tin::HeightField Model(const std::string& file, const Window& window) {
  std::optional<tin::HeightField> field = ReadField(file, window);
  if (!field) Die("the paper's elevation models are needed; set TERRACE_TEST_DATA");
  return *std::move(field);
}

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

Series GreedyCurve(const tin::HeightField& field, const std::string& name, const tin::GreedyOptions& options) {
  Series series{name, {}};
  tin::GreedyTriangulation tin(field, options);
  for (const std::size_t points : VertexCounts(field)) {
    tin.Run({0, points});
    series.points.emplace_back(points, tin::MeasureError(field, tin.Mesh()).rms);
  }
  return series;
}

}  // namespace terrace::bench
