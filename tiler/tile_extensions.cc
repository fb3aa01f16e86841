#include "tiler/tile_extensions.h"

#include <utility>
#include <vector>

#include "proto/mesh/tile_metadata.h"
#include "proto/mesh/water_mask.h"

namespace terrace::tiler {
namespace {

static_assert(dem::WaterRaster::kSide == proto::kWaterMaskSide);

// A sea level is in the source's vertical datum: if tiles have another datum, heights are read again in the source's.
Result<proto::WaterMask> SeaMaskOf(const Dataset& dataset, const proto::LatticeView& lattice,
                                   const std::stop_token& stop) {
  const double sea_level_m = *dataset.water.sea_level_m;
  if (!dataset.source->converts()) return proto::Shortest(proto::SeaLevelMask(lattice, sea_level_m));
  const Result<dem::TileHeights> counted = dataset.source->ReadAsCounted(lattice.key, stop);
  if (!counted) return tl::unexpected(counted.error());
  return proto::Shortest(proto::SeaLevelMask({lattice.key, counted->lattice, counted->heights}, sea_level_m));
}

Result<proto::WaterMask> WaterMaskOf(const Dataset& dataset, const proto::LatticeView& lattice,
                                     const std::stop_token& stop) {
  if (dataset.water.sea_level_m) return SeaMaskOf(dataset, lattice, stop);
  Result<proto::WaterMask> mask = dataset.water.mask->Read(lattice.key, stop);
  if (mask) *mask = proto::Shortest(*std::move(mask));
  return mask;
}

}  // namespace

Result<proto::QuantizedMeshOptions> AddExtensions(const Dataset& dataset, const TileRequest& request,
                                                  const proto::LatticeView& lattice, proto::QuantizedTile& tile,
                                                  const std::stop_token& stop) {
  proto::QuantizedMeshOptions options;
  options.normals = request.normals;
  options.water_mask = request.water_mask && dataset.water.any();
  options.metadata = request.metadata &&
                     proto::CarriesMetadata(request.key.level, dataset.metadata_levels, dataset.source->max_level());
  if (options.water_mask) {
    Result<proto::WaterMask> mask = WaterMaskOf(dataset, lattice, stop);
    if (!mask) return tl::unexpected(std::move(mask).error());
    tile.water_mask = *std::move(mask);
  }
  if (options.metadata) {
    tile.metadata = proto::EncodeTileMetadata(request.key, dataset.source->Availability(), dataset.metadata_levels);
  }
  return options;
}

}  // namespace terrace::tiler
