#include "server/api/tile_formats.h"

#include <iterator>

#include "engine/core/check.h"
#include "proto/media_type.h"
#include "proto/mesh/tile_metadata.h"
#include "server/api/negotiate.h"
#include "server/query/query.h"

namespace terrace::server {
namespace {

using tiler::TileRequest;

tl::unexpected<Error> NoSuchTile() {
  return MakeError(ErrorCode::kNotFound, "the dataset has no such tile; its layer.json lists what it has");
}

void SetError(const RequestedError& requested, const DatasetView& dataset, TileRequest& tile) {
  const int level = tile.key.level;
  tile.error_step = ErrorStep(requested, level, level == dataset.max_level(), dataset.error_fraction);
}

Result<void> ReadQuantizedMesh(std::string_view query, const RequestFields& fields, const DatasetView& dataset,
                               TileRequest& tile) {
  const Result<TileParameters> parameters = ParseTileParameters(query, /*allow_at_least=*/true);
  if (!parameters) return tl::unexpected(parameters.error());
  if (!IsAvailable(dataset, tile.key)) return NoSuchTile();
  SetError(parameters->requested, dataset, tile);
  tile.coding = NegotiateCoding(fields.accept_encoding);
  const proto::TileExtensions wanted = WantedExtensions(fields.accept, parameters->extensions);
  tile.normals = wanted.octvertexnormals;
  tile.water_mask = wanted.watermask && dataset.has_water;
  tile.metadata =
      wanted.metadata && proto::CarriesMetadata(tile.key.level, dataset.metadata_levels, dataset.max_level());
  return {};
}

// Draco output is entropy-coded already; meshopt output is not.
bool CodingHelps(const TileRequest& glb) { return glb.compression != proto::GlbCompression::kDraco; }

Result<void> ReadGlb(std::string_view query, const RequestFields& fields, const DatasetView& dataset,
                     TileRequest& tile) {
  const Result<TileParameters> parameters =
      ParseTileParameters(query, /*allow_at_least=*/true, /*allow_compression=*/true);
  if (!parameters) return tl::unexpected(parameters.error());
  if (!IsAvailable(dataset, tile.key)) return NoSuchTile();
  SetError(parameters->requested, dataset, tile);
  tile.compression = parameters->compression.value_or(dataset.glb_compression);
  if (dataset.texture) tile.texture = parameters->texture.value_or(*dataset.texture);
  if (CodingHelps(tile)) tile.coding = NegotiateCoding(fields.accept_encoding);
  return {};
}

// PNG is compressed already, so it is sent unchanged whatever the client accepts.
Result<void> ReadHeightPng(std::string_view query, const RequestFields&, const DatasetView& dataset,
                           TileRequest& tile) {
  const Result<HeightTileParameters> parameters = ParseHeightTileParameters(query);
  if (!parameters) return tl::unexpected(parameters.error());
  if (!IsHeightTileAvailable(dataset, tile.key, parameters->size)) {
    return MakeError(ErrorCode::kNotFound,
                     "the dataset has no such tile; its tiles.json tells the bounds and levels of what it has");
  }
  tile.height_encoding = parameters->encoding;
  tile.height_size = parameters->size;
  return {};
}

std::string_view QuantizedMeshType(const TileRequest& tile) {
  return proto::QuantizedMeshContentType({tile.normals, tile.water_mask, tile.metadata});
}
std::string_view GlbType(const TileRequest&) { return "model/gltf-binary"; }
std::string_view PngType(const TileRequest&) { return "image/png"; }

// Accept asks for extensions.
std::string_view QuantizedMeshVary(const TileRequest&) { return "Accept, Accept-Encoding"; }
std::string_view GlbVary(const TileRequest& tile) { return CodingHelps(tile) ? "Accept-Encoding" : ""; }
std::string_view PngVary(const TileRequest&) { return ""; }

constexpr TileFormat kFormats[] = {
    {tiler::TileFormat::kQuantizedMesh, ".terrain", /*is_mercator=*/false, QuantizedMeshType, QuantizedMeshVary,
     ReadQuantizedMesh},
    {tiler::TileFormat::kGlb, ".glb", /*is_mercator=*/false, GlbType, GlbVary, ReadGlb},
    {tiler::TileFormat::kHeightPng, ".png", /*is_mercator=*/true, PngType, PngVary, ReadHeightPng},
};

}  // namespace

const TileFormat& RowOf(tiler::TileFormat format) {
  for (const TileFormat& row : kFormats) {
    if (row.format == format) return row;
  }
  TERRACE_CHECK(false);
}

const TileFormat* CutSuffix(std::string_view& name) {
  for (const TileFormat& row : kFormats) {
    if (!name.ends_with(row.suffix)) continue;
    name.remove_suffix(row.suffix.size());
    return &row;
  }
  return nullptr;
}

}  // namespace terrace::server
