#include "proto/mesh/quantized_mesh.h"

#include <utility>

#include "engine/core/elapsed_time.h"
#include "engine/dem/tile_edits.h"
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

// A sea level is in the vertical datum of each source: if tiles have another datum, heights are read again in it.
Result<proto::WaterMask> SeaMaskOf(const Dataset& dataset, const proto::TileSamples& samples,
                                   const std::stop_token& stop) {
  const double sea_level_m = *dataset.water.sea_level_m;
  if (!dataset.model->has_geoid()) return proto::Shortest(proto::SeaLevelMask(samples, sea_level_m));
  const Result<dem::TileHeights> in_source_datum = dataset.model->ReadInSourceDatum(samples.key, stop);
  if (!in_source_datum) return tl::unexpected(in_source_datum.error());
  return proto::Shortest(
      proto::SeaLevelMask({samples.key, in_source_datum->lattice, in_source_datum->heights}, sea_level_m));
}

Result<proto::WaterMask> WaterMaskOf(const Dataset& dataset, const proto::TileSamples& samples,
                                     const std::stop_token& stop) {
  if (dataset.water.sea_level_m) return SeaMaskOf(dataset, samples, stop);
  Result<proto::WaterMask> mask = dataset.water.mask->Read(samples.key, stop);
  if (mask) *mask = proto::Shortest(*std::move(mask));
  return mask;
}

// Adds the water mask and the metadata to `tile`, if `request` asks for them and the dataset has them. Returns the
// extensions to encode, including normals.
Result<proto::TileExtensions> AddExtensions(const Dataset& dataset, const TileRequest& request,
                                            const proto::TileSamples& samples, proto::QuantizedTile& tile,
                                            const std::stop_token& stop) {
  proto::TileExtensions extensions = request.extensions;
  extensions.water_mask = extensions.water_mask && dataset.water.any();
  extensions.metadata =
      extensions.metadata && proto::CarriesMetadata(request.key, dataset.metadata_availability,
                                                    dataset.model->max_source_level(), dataset.model->Availability());
  if (extensions.water_mask) {
    Result<proto::WaterMask> mask = WaterMaskOf(dataset, samples, stop);
    if (!mask) return tl::unexpected(std::move(mask).error());
    tile.water_mask = *std::move(mask);
  }
  if (extensions.metadata) {
    tile.metadata = proto::EncodeTileMetadata(
        request.key, dem::TileEdits(*dataset.model).AvailabilityToDepthOf(request.key), dataset.metadata_availability);
  }
  return extensions;
}

}  // namespace

Result<DrawnTriangles> QuantizedMeshTriangles(const EncoderInput& input, const std::stop_token& stop) {
  Result<MeshedTile> meshed = MeshTile(*input.dataset.model, input.samples(), input.refined->refinement,
                                       input.dataset.mesh_options, input.error_m, stop);
  if (!meshed) return tl::unexpected(meshed.error());
  DrawnTriangles drawn = TrianglesOf(meshed->tile);
  drawn.in_hole = std::move(meshed->in_hole);
  return drawn;
}

Result<void> MakeQuantizedMeshTile(const EncoderInput& input, EncodedTile& encoded, const std::stop_token& stop) {
  const auto& [dataset, request, refined, error_m] = input;
  const auto start = std::chrono::steady_clock::now();
  proto::TileSamples samples = input.samples();
  const proto::LatticeAngles angles(samples);
  samples.angles = &angles;
  Result<MeshedTile> measured =
      MeshTile(*dataset.model, samples, refined->refinement, dataset.mesh_options, error_m, stop);
  if (!measured) return tl::unexpected(std::move(measured).error());
  if (request.extensions.normals) {
    measured->tile.normals = proto::TileNormals(samples, measured->mesh, measured->positions);
  }
  const Result<proto::TileExtensions> extensions = AddExtensions(dataset, request, samples, measured->tile, stop);
  if (!extensions) return tl::unexpected(extensions.error());
  LeaveOut(measured->in_hole, measured->mesh, samples.cells(), measured->tile.triangles);
  encoded.bytes = proto::EncodeQuantizedMesh(measured->tile, *extensions, measured->positions);
  encoded.times.refine += measured->replay_time;
  encoded.times.encode = MicrosecondsSince(start) - measured->replay_time;
  encoded.max_error_m = measured->max_error_m;
  encoded.certified_error_m = measured->surface_error_m + refined->heights.source_error_m;
  encoded.vertices = static_cast<std::uint32_t>(measured->tile.u.size());
  encoded.triangles = static_cast<std::uint32_t>(measured->tile.triangles.size());
  return {};
}

}  // namespace terrace::tiler
