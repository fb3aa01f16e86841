#include "server/api/tile_formats.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <iterator>
#include <optional>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/parse_number.h"
#include "engine/geo/mercator_grid.h"
#include "proto/format_error_up.h"
#include "proto/mesh/tile_metadata.h"
#include "server/api/map_formats.h"
#include "server/http/text.h"
#include "server/openapi/operations.h"
#include "server/query/tile_query.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::server {
namespace {

using tiler::TileRequest;

tl::unexpected<Error> NoSuchTile() {
  return MakeError(ErrorCode::kNotFound, "the dataset has no such tile; its layer.json lists what it has");
}

// Among codings that a client likes equally, that of the dataset's archive comes first: its tiles are sent as stored.
std::span<const tiler::Coding> CodingsOf(const DatasetView& dataset) {
  using tiler::Coding;
  static constexpr std::array<Coding, 3> kGzipFirst = {Coding::kGzip, Coding::kBrotli, Coding::kZstd};
  if (dataset.baked_coding == Coding::kGzip) return kGzipFirst;
  return tiler::kCodings;
}

Result<void> ReadQuantizedMesh(std::string_view query, const RequestFields& fields, const DatasetView& dataset,
                               TileRequest& tile) {
  const Result<TileParameters> parameters = ParseTileParameters(query, /*allow_at_least=*/true);
  if (!parameters) return tl::unexpected(parameters.error());
  if (!IsAvailable(dataset, tile.key)) return NoSuchTile();
  tile.error_step = geo::ErrorStep(parameters->requested, tile.key.level, dataset.error_scale);
  tile.coding = NegotiateCoding(fields.accept_encoding, CodingsOf(dataset));
  const proto::TileExtensions wanted = WantedExtensions(fields.accept, parameters->extensions);
  tile.extensions.normals = wanted.normals && (!dataset.only_archive || dataset.only_archive->extent().normals);
  tile.extensions.water_mask = wanted.water_mask && dataset.has_water;
  tile.extensions.metadata =
      wanted.metadata && proto::CarriesMetadata(tile.key, dataset.metadata_availability,
                                                dataset.error_scale.max_source_level, dataset.available);
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
  tile.error_step = geo::ErrorStep(parameters->requested, tile.key.level, dataset.error_scale);
  tile.compression = parameters->compression.value_or(dataset.glb_compression);
  if (dataset.texture) tile.texture = parameters->texture.value_or(*dataset.texture);
  if (CodingHelps(tile)) tile.coding = NegotiateCoding(fields.accept_encoding, CodingsOf(dataset));
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
  tile.side_px = parameters->size;
  return {};
}

std::string_view QuantizedMeshType(const TileRequest& tile) { return proto::QuantizedMeshContentType(tile.extensions); }
std::string_view GlbType(const TileRequest&) { return "model/gltf-binary"; }
std::string_view PngType(const TileRequest&) { return "image/png"; }

// Accept asks for extensions.
std::string_view QuantizedMeshVary(const TileRequest&) { return "Accept, Accept-Encoding"; }
std::string_view GlbVary(const TileRequest& tile) { return CodingHelps(tile) ? "Accept-Encoding" : ""; }
std::string_view NoVary(const TileRequest&) { return ""; }

Result<void> ReadPicture(std::string_view query, const RequestFields&, const DatasetView& dataset, TileRequest& tile) {
  return ReadMapTile(query, dataset, tile);
}
Result<void> ReadContours(std::string_view query, const RequestFields& fields, const DatasetView& dataset,
                          TileRequest& tile) {
  tile.coding = NegotiateCoding(fields.accept_encoding);
  return ReadMapTile(query, dataset, tile);
}
std::string_view ContoursVary(const TileRequest&) { return "Accept-Encoding"; }

using tiler::TileFormat::kContours, tiler::TileFormat::kGeodeticImagery, tiler::TileFormat::kHillshade,
    tiler::TileFormat::kImagery, tiler::TileFormat::kSlope;
constexpr proto::PictureFormat kPng = proto::PictureFormat::kPng, kWebp = proto::PictureFormat::kWebp,
                               kJpeg = proto::PictureFormat::kJpeg;

constexpr TileFormatRow kFormats[] = {
    {tiler::TileFormat::kQuantizedMesh, "", ".terrain", QuantizedMeshType, QuantizedMeshVary, ReadQuantizedMesh,
     proto::PictureFormat::kPng, &kTerrainTileOperation},
    {tiler::TileFormat::kGlb, "", ".glb", GlbType, GlbVary, ReadGlb, proto::PictureFormat::kPng, &kGlbTileOperation},
    {tiler::TileFormat::kHeightPng, "", ".png", PngType, NoVary, ReadHeightPng, proto::PictureFormat::kPng,
     &kHeightTileOperation},
    {kHillshade, "hillshade", ".png", MapTileType, NoVary, ReadPicture, kPng, &kHillshadePngOperation},
    {kHillshade, "hillshade", ".webp", MapTileType, NoVary, ReadPicture, kWebp, &kHillshadeWebpOperation},
    {kSlope, "slope", ".png", MapTileType, NoVary, ReadPicture, kPng, &kSlopePngOperation},
    {kSlope, "slope", ".webp", MapTileType, NoVary, ReadPicture, kWebp, &kSlopeWebpOperation},
    {kContours, "contours", ".mvt", MapTileType, ContoursVary, ReadContours, kPng, &kContoursOperation},
    {kImagery, "imagery", ".webp", MapTileType, NoVary, ReadPicture, kWebp, &kImageryWebpOperation},
    {kImagery, "imagery", ".jpg", MapTileType, NoVary, ReadPicture, kJpeg, &kImageryJpegOperation},
    {kGeodeticImagery, "imagery/geodetic", ".webp", MapTileType, NoVary, ReadPicture, kWebp,
     &kGeodeticImageryWebpOperation},
    {kGeodeticImagery, "imagery/geodetic", ".jpg", MapTileType, NoVary, ReadPicture, kJpeg,
     &kGeodeticImageryJpegOperation},
};

constexpr std::string_view kBlanksAndQuotes = " \t\"";

// The coding of a name; nothing if it is not supported.
std::optional<tiler::Coding> CodingOf(std::string_view name) {
  if (EqualsIgnoringCase(name, "identity")) return tiler::Coding::kIdentity;
  if (EqualsIgnoringCase(name, "x-gzip")) return tiler::Coding::kGzip;
  for (const tiler::Coding coding : tiler::kCodings) {
    if (EqualsIgnoringCase(name, tiler::NameOf(coding))) return coding;
  }
  return std::nullopt;
}

// A malformed quality, or one outside 0 .. 1, counts as 0.
double Quality(std::string_view parameters) {
  while (!parameters.empty()) {
    const std::string_view parameter = NextPiece(parameters, ';', kBlanksAndQuotes);
    if (!parameter.starts_with("q=") && !parameter.starts_with("Q=")) continue;
    const double quality = ParseNumber<double>(parameter.substr(2), std::chars_format::fixed).value_or(0);
    return quality >= 0 && quality <= 1 ? quality : 0;
  }
  return 1;
}

}  // namespace

tiler::Coding NegotiateCoding(std::string_view accept_encoding, std::span<const tiler::Coding> offered) {
  constexpr std::size_t kKnown = 1 + tiler::kCodings.size();
  std::array<std::optional<double>, kKnown> named;  // qualities, by coding
  std::optional<double> any;
  while (!accept_encoding.empty()) {
    std::string_view item = NextPiece(accept_encoding, ',', kBlanksAndQuotes);
    const std::string_view name = NextPiece(item, ';', kBlanksAndQuotes);
    const double quality = Quality(item);
    if (name == "*") {
      any = quality;
    } else if (const std::optional<tiler::Coding> coding = CodingOf(name)) {
      std::optional<double>& known = named[static_cast<std::size_t>(*coding)];
      known = std::max(known.value_or(0), quality);
    }
  }
  // Identity that is not mentioned is used only if no offered coding is acceptable.
  tiler::Coding best = tiler::Coding::kIdentity;
  double most = named[static_cast<std::size_t>(tiler::Coding::kIdentity)].value_or(0);
  for (const tiler::Coding coding : offered) {
    const double quality = named[static_cast<std::size_t>(coding)].value_or(any.value_or(0));
    if (quality <= 0 || quality < most || (quality == most && best != tiler::Coding::kIdentity)) continue;
    best = coding;
    most = quality;
  }
  return best;
}

proto::TileExtensions WantedExtensions(std::string_view accept, const std::vector<std::string>& query_extensions) {
  proto::TileExtensions wanted = proto::ExtensionsInAccept(accept);
  for (const std::string& names : query_extensions) wanted = wanted | proto::ParseExtensions(names);
  return wanted;
}

Result<void> CheckHasFormat(const DatasetView& dataset, tiler::TileFormat format) {
  const bool is_image = format == tiler::TileFormat::kImagery && dataset.imagery;
  const dem::GeoBounds& bounds = is_image ? dataset.imagery->bounds : dataset.bounds;
  const bool is_polar = bounds.south >= geo::kMercatorLatitude || bounds.north <= -geo::kMercatorLatitude;
  if (tiler::IsMercator(format) && is_polar) {
    return MakeError(ErrorCode::kNotFound, "the {} lies beyond 85.05 degrees of latitude, where Web Mercator ends",
                     is_image ? "image" : "dataset");
  }
  if (!dataset.only_archive) return {};
  const std::vector<tiler::TileFormat>& formats = dataset.only_archive->extent().formats;
  if (std::ranges::find(formats, format) != formats.end()) return {};
  const auto* const row = std::ranges::find(kFormats, format, &TileFormatRow::format);
  TERRACE_CHECK(row != std::end(kFormats));
  return MakeError(ErrorCode::kNotFound, "the dataset is an archive of finished tiles alone, which has no {} tiles",
                   row->folder.empty() ? row->suffix : row->folder);
}

Result<void> CheckHasQueriedTiles(const DatasetView& dataset, tiler::TileFormat format, std::string_view query) {
  if (!dataset.only_archive || query.empty()) return {};
  const tiler::BakedTiles& baked = *dataset.only_archive;
  const auto check = [&](const TileRequest& tile) {
    return baked.HasKind(tile) ? Result<void>() : tl::unexpected(baked.WhyAbsent(tile));
  };
  TileRequest tile;
  tile.format = format;
  if (format == tiler::TileFormat::kHeightPng) {
    const Result<HeightTileParameters> parameters = ParseHeightTileParameters(query);
    if (!parameters) return tl::unexpected(parameters.error());
    tile.height_encoding = parameters->encoding;
    tile.side_px = parameters->size;
    return check(tile);
  }
  const auto* const row = std::ranges::find(kFormats, format, &TileFormatRow::format);
  TERRACE_CHECK(row != std::end(kFormats));
  const std::vector<std::vector<geo::TileRange>>& available = baked.extent().available;
  for (std::size_t level = 0; level < available.size(); ++level) {
    if (available[level].empty()) continue;
    tile.key = {static_cast<int>(level), available[level].front().start_x, available[level].front().start_y};
    if (Result<void> read = row->read(query, {}, dataset, tile); !read) return read;
    if (Result<void> has = check(tile); !has) return has;
  }
  return {};
}

Result<std::uint32_t> FindDataset(std::string_view name, std::span<const DatasetView> datasets) {
  for (std::size_t i = 0; i < datasets.size(); ++i) {
    if (datasets[i].name == name) return static_cast<std::uint32_t>(i);
  }
  return MakeError(ErrorCode::kNotFound, "no such dataset; /datasets lists them");
}

std::span<const TileFormatRow> TileFormatRows() { return kFormats; }

const TileFormatRow* TakeFormat(std::string_view& name, std::string_view folder) {
  for (const TileFormatRow& row : kFormats) {
    if (row.folder != folder || !name.ends_with(row.suffix)) continue;
    name.remove_suffix(row.suffix.size());
    return &row;
  }
  return nullptr;
}

const TileFormatRow* FirstFormatIn(std::string_view folder) {
  const auto* const row = std::ranges::find(kFormats, folder, &TileFormatRow::folder);
  return row == std::end(kFormats) ? nullptr : row;
}

const TileFormatRow* FormatWith(tiler::TileFormat format, proto::PictureFormat picture) {
  const auto* const row = std::ranges::find_if(
      kFormats, [&](const TileFormatRow& of) { return of.format == format && of.picture == picture; });
  return row == std::end(kFormats) ? nullptr : row;
}

Result<TileRequest> NegotiateTile(const RequestContext& context, std::span<const DatasetView> datasets) {
  const Route& route = context.route;
  const Result<std::uint32_t> dataset = FindDataset(route.dataset, datasets);
  if (!dataset) return tl::unexpected(dataset.error());
  if (Result<void> has = CheckHasFormat(datasets[*dataset], route.format->format); !has) {
    return tl::unexpected(std::move(has.error()));
  }
  TileRequest tile;
  tile.dataset = *dataset;
  tile.key = route.key;
  tile.format = route.format->format;
  tile.map.picture = route.format->picture;
  if (Result<void> read = route.format->read(route.query, *context.request->fields, datasets[*dataset], tile); !read) {
    return tl::unexpected(std::move(read.error()));
  }
  return tile;
}

tiler::HeaderLines MakeTileHeaders(const TileRequest& request, const tiler::EncodedTile& tile) {
  const auto* const row = std::ranges::find(kFormats, request.format, &TileFormatRow::format);
  TERRACE_CHECK(row != std::end(kFormats));
  tiler::HeaderLines head;
  const auto put = [to = std::back_inserter(head.text)](std::string_view name, const auto& value) {
    fmt::format_to(to, "{}: {}\r\n", name, value);
  };
  put("Content-Type", row->media_type(request));
  if (request.coding != tiler::Coding::kIdentity) put("Content-Encoding", tiler::NameOf(request.coding));
  put("Content-Length", tile.bytes.size());
  head.bytes_about_body = head.text.size();
  if (!tile.etag.empty()) put("ETag", tile.etag);
  if (!tiler::IsMapLayer(request.format)) put("Terrain-Max-Error", proto::FormatErrorUp(tile.max_error_m));
  if (tile.certified_error_m && std::isfinite(*tile.certified_error_m)) {
    put("Terrain-Certified-Error", proto::FormatErrorUp(*tile.certified_error_m));
  }
  head.text.shrink_to_fit();
  return head;
}

}  // namespace terrace::server
