#include "tests/tiler/fetched_tile.h"

#include <algorithm>
#include <cstddef>
#include <utility>

#include "engine/geo/tile_key.h"
#include "tests/support/source_dir.h"

namespace terrace::tiler {

Dataset OpenDataset(const std::string& name, const std::string& path) {
  auto source = dem::ElevationModel::Open(path);
  Dataset dataset;
  dataset.name = name;
  EXPECT_TRUE(source.has_value()) << (source ? "" : source.error().message);
  if (source) dataset.model = *std::move(source);
  if (dataset.model) dataset.generation = dataset.model->fingerprint();  // pipelines use it as the cache key
  return dataset;
}

Dataset OpenSample(const std::string& name) {
  return OpenDataset(name, test_support::SourceDir() / "config/samples" / (name + ".tif"));
}

const TilePipeline& SamplePipeline() {
  static const TilePipeline* const pipeline = [] {
    std::vector<Dataset> datasets;
    datasets.push_back(OpenSample("etopo5"));
    datasets.push_back(OpenSample("jacksboro"));
    return new TilePipeline(std::move(datasets));
  }();
  return *pipeline;
}

FetchedTile FetchTile(const TilePipeline& pipeline, TileRequest request) {
  request.extensions.normals = true;
  auto encoded = pipeline.Build(request, {});
  EXPECT_TRUE(encoded.has_value()) << geo::ToString(request.key) << ": " << (encoded ? "" : encoded.error().message);
  if (!encoded) return {};
  auto mesh = proto::DecodeQuantizedMesh(encoded->bytes);
  EXPECT_TRUE(mesh.has_value()) << geo::ToString(request.key);
  if (!mesh) return {};
  return {*std::move(mesh), *std::move(encoded)};
}

Edge EdgeOf(const FetchedTile& tile, bool vertical, int fixed) {
  Edge edge;
  const proto::DecodedTile& mesh = tile.mesh;
  const std::string& normals = mesh.extensions.at(0).bytes;
  const double min = static_cast<double>(mesh.min_height), max = static_cast<double>(mesh.max_height);
  for (std::size_t k = 0; k < mesh.u.size(); ++k) {
    if ((vertical ? mesh.u[k] : mesh.v[k]) != fixed) continue;
    edge.emplace_back(vertical ? mesh.v[k] : mesh.u[k], min + (max - min) * mesh.h[k] / 32767, normals[2 * k],
                      normals[2 * k + 1]);
  }
  std::sort(edge.begin(), edge.end());
  return edge;
}

}  // namespace terrace::tiler
