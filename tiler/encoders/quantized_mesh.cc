#include "proto/mesh/quantized_mesh.h"

#include <utility>

#include "engine/core/elapsed_time.h"
#include "proto/lattice_angles.h"
#include "proto/mesh/tile_metadata.h"
#include "proto/mesh/tile_normals.h"
#include "proto/mesh/water_mask.h"
#include "tiler/encoders.h"
#include "tiler/mesh/edit_limits.h"
#include "tiler/mesh/tile_mesher.h"
#include "tiler/surface/quantized_mesh_triangles.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::tiler {
namespace {

static_assert(dem::WaterRaster::kSide == proto::kWaterMaskSide);

// A sea level is in the source's vertical datum: if tiles have another datum, heights are read again in the source's.
Result<proto::WaterMask> SeaMaskOf(const Dataset& dataset, const proto::LatticeView& lattice,
                                   const std::stop_token& stop) {
  const double sea_level_m = *dataset.water.sea_level_m;
  if (!dataset.source->converts()) return proto::Shortest(proto::SeaLevelMask(lattice, sea_level_m));
  const Result<dem::TileHeights> in_source_datum = dataset.source->ReadInSourceDatum(lattice.key, stop);
  if (!in_source_datum) return tl::unexpected(in_source_datum.error());
  return proto::Shortest(
      proto::SeaLevelMask({lattice.key, in_source_datum->lattice, in_source_datum->heights}, sea_level_m));
}

Result<proto::WaterMask> WaterMaskOf(const Dataset& dataset, const proto::LatticeView& lattice,
                                     const std::stop_token& stop) {
  if (dataset.water.sea_level_m) return SeaMaskOf(dataset, lattice, stop);
  Result<proto::WaterMask> mask = dataset.water.mask->Read(lattice.key, stop);
  if (mask) *mask = proto::Shortest(*std::move(mask));
  return mask;
}

// Adds the water mask and the metadata to `tile`, if `request` asks for them and the dataset has them. Returns the
// extensions to encode, including normals.
Result<proto::TileExtensions> AddExtensions(const Dataset& dataset, const TileRequest& request,
                                            const proto::LatticeView& lattice, proto::QuantizedTile& tile,
                                            const std::stop_token& stop) {
  proto::TileExtensions extensions = request.extensions;
  extensions.water_mask = extensions.water_mask && dataset.water.any();
  extensions.metadata =
      extensions.metadata && proto::CarriesMetadata(request.key, dataset.metadata_levels,
                                                    dataset.source->max_source_level(), dataset.source->Availability());
  if (extensions.water_mask) {
    Result<proto::WaterMask> mask = WaterMaskOf(dataset, lattice, stop);
    if (!mask) return tl::unexpected(std::move(mask).error());
    tile.water_mask = *std::move(mask);
  }
  if (extensions.metadata) {
    tile.metadata =
        proto::EncodeTileMetadata(request.key, dataset.source->AvailabilityBelow(request.key), dataset.metadata_levels);
  }
  return extensions;
}

}  // namespace

Result<DrawnTriangles> DrawnByQuantizedMesh(const EncoderInput& input, const std::stop_token& stop) {
  const Result<MeshedTile> meshed = MeshTile(*input.dataset.source, input.lattice(), input.refined->refinement,
                                             input.dataset.mesh_options, input.error_m, stop);
  if (!meshed) return tl::unexpected(meshed.error());
  DrawnTriangles drawn = TrianglesOf(meshed->tile);
  drawn.in_hole = TrianglesInHoles(*input.dataset.source, meshed->tile.key, meshed->mesh);
  return drawn;
}

Result<void> MakeQuantizedMeshTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  const auto& [dataset, request, refined, error_m] = input;
  const auto start = std::chrono::steady_clock::now();
  proto::LatticeView lattice = input.lattice();
  const proto::LatticeAngles angles(lattice);
  lattice.angles = &angles;
  Result<MeshedTile> measured =
      MeshTile(*dataset.source, lattice, refined->refinement, dataset.mesh_options, error_m, stop);
  if (!measured) return tl::unexpected(std::move(measured).error());
  if (request.extensions.normals) {
    measured->tile.normals = proto::TileNormals(lattice, measured->mesh, measured->positions);
  }
  const Result<proto::TileExtensions> extensions = AddExtensions(dataset, request, lattice, measured->tile, stop);
  if (!extensions) return tl::unexpected(extensions.error());
  LeaveOut(TrianglesInHoles(*dataset.source, request.key, measured->mesh), measured->mesh, lattice.cells(),
           measured->tile.triangles);
  encoded.bytes = proto::EncodeQuantizedMesh(measured->tile, *extensions, measured->positions);
  encoded.times.refine += measured->replayed;
  encoded.times.encode = MicrosecondsSince(start) - measured->replayed;
  encoded.max_error_m = measured->max_error_m;
  encoded.certified_error_m = measured->surface_error_m + refined->heights.source_error_m;
  encoded.vertices = static_cast<std::uint32_t>(measured->tile.u.size());
  encoded.triangles = static_cast<std::uint32_t>(measured->tile.triangles.size());
  return {};
}

}  // namespace terrace::tiler
