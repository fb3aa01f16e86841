#include "tiler/dataset.h"

#include <fmt/format.h>
#include <xxhash.h>

#include "engine/common/content_hash.h"
#include "engine/dem/tile_edits.h"
#include "tiler/encoder_version.h"
#include "tiler/map/contour_tile.h"
#include "tiler/map/map_heights.h"
#include "tiler/map/relief.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::tiler {
namespace {

// Combines two hashes; 0 if both are 0.
std::uint64_t Mixed(std::uint64_t edits, std::uint64_t deeper) {
  if (edits == 0 || deeper == 0) return edits | deeper;
  dem::ContentHasher hasher;
  hasher.Add(edits);
  hasher.Add(deeper);
  return hasher.Hash().low | 1;
}

}  // namespace

geo::ErrorScale Dataset::error_scale() const {
  if (model) return {error_fraction, model->max_source_level()};
  return {error_fraction, baked->extent().max_source_level, baked->extent().error_steps};
}

std::uint64_t GenerationOf(const Dataset& dataset, std::uint64_t heights) {
  const WaterOptions& water = dataset.water;
  const ImageryOptions& imagery = dataset.imagery;
  const std::string text = fmt::format(
      "{}:{} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {} {}:{} {}:{}", dataset.glb.generator.size(),
      dataset.glb.generator, EncoderText(), heights, dataset.error_fraction,
      static_cast<int>(dataset.mesh_options.criterion), dataset.mesh_options.compact,
      static_cast<int>(dataset.glb.compression), dataset.glb.draco.speed, dataset.glb.draco.normal_bits,
      water.mask ? water.mask->fingerprint() : 0, water.sea_level_m ? fmt::format("{}", *water.sea_level_m) : "none",
      dataset.metadata_availability, imagery.image ? imagery.image->fingerprint() : 0,
      static_cast<int>(imagery.texture), imagery.side, imagery.quality, imagery.attribution.size(), imagery.attribution,
      dataset.attribution.size(), dataset.attribution);
  return XXH3_64bits(text.data(), text.size());
}

std::uint64_t TileEditsHash(const dem::ElevationModel& model, const TileRequest& request) {
  const dem::TileEdits edits(model);
  int size = request.side_px, margin = 0;
  switch (request.format) {
    case TileFormat::kQuantizedMesh:
    case TileFormat::kGlb:
      return request.extensions.metadata ? Mixed(edits.Hash(request.key), edits.DeeperTilesHash(request.key))
                                         : edits.Hash(request.key);
    case TileFormat::kImagery:
    case TileFormat::kGeodeticImagery:
      return 0;
    case TileFormat::kHeightPng:
      break;
    case TileFormat::kHillshade:
    case TileFormat::kSlope:
      margin = kReliefMargin;
      break;
    case TileFormat::kContours:
      size = kSidesPx[0];
      margin = kContourMargin;
      break;
  }
  const MapWindow window(request.key, size, margin);
  if (window.depth > model.info().max_mercator_depth) return 0;
  return edits.MercatorHash(window.depth, window.nodes);
}

}  // namespace terrace::tiler
