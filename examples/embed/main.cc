// One tile without a server: an elevation model in, a quantized-mesh tile out.
//
//   embed DEM LEVEL X Y ERROR_M OUT.terrain
//
// Tiles are those of EPSG:4326 in the TMS scheme: two at level 0, y from the south. The engine's messages about the
// model go to spdlog's default logger.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

#include "engine/dem/elevation_model.h"
#include "engine/geo/error_ladder.h"
#include "tiler/tile_pipeline.h"

int main(int count, char** arguments) {
  using namespace terrace;
  const double error_m = count == 7 ? std::atof(arguments[5]) : 0;
  if (!std::isfinite(error_m) || error_m <= 0) {
    std::fputs("usage: embed DEM LEVEL X Y ERROR_M OUT.terrain\n", stderr);
    return 2;
  }
  auto model = dem::ElevationModel::Open(arguments[1]);
  if (!model) {
    std::fprintf(stderr, "embed: %s\n", model.error().message.c_str());
    return 1;
  }
  tiler::Dataset dataset;
  dataset.name = "dem";
  dataset.model = *std::move(model);
  const double error_fraction = dataset.error_fraction;
  const tiler::TilePipeline pipeline({std::move(dataset)});

  tiler::TileRequest request;
  request.key = {std::atoi(arguments[2]), std::atoll(arguments[3]), std::atoll(arguments[4])};
  request.error_step = geo::SnapToLadder(request.key.level, error_m, error_fraction);
  const Result<tiler::EncodedTile> tile = pipeline.Build(request, {});
  if (!tile) {
    std::fprintf(stderr, "embed: %s\n", tile.error().message.c_str());
    return 1;
  }
  std::ofstream out(arguments[6], std::ios::binary);
  if (!(out << tile->bytes) || !out.flush()) {
    std::fprintf(stderr, "embed: %s cannot be written\n", arguments[6]);
    return 1;
  }
  std::printf("%u triangles, error %.6g m at the samples of the tile, %.6g m at those of the source\n", tile->triangles,
              tile->max_error_m, *tile->certified_error_m);
  return 0;
}
