#include <fmt/format.h>

#include <utility>

#include "engine/core/names.h"
#include "proto/documents/map_picture.h"
#include "proto/documents/picture_names.h"
#include "proto/documents/tile_json.h"
#include "server/api/caching.h"
#include "server/api/map_formats.h"
#include "server/api/tile_formats.h"
#include "server/documents/document.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "tiler/map/contour_tile.h"

namespace terrace::server {
namespace {

// Default parameters are omitted, so that a tile has one URL.
std::string HeightTileQuery(const DatasetView& dataset, const HeightTileParameters& parameters) {
  std::string query = "v=" + dataset.version();
  const auto add = [&query](const std::string& text) { query += "&" + text; };
  const HeightTileParameters defaults;
  if (parameters.encoding != defaults.encoding)
    add(fmt::format("encoding={}", NameIn(proto::kHeightEncodingNames, parameters.encoding)));
  if (parameters.size != defaults.size) add(fmt::format("size={}", parameters.size));
  return query;
}

// "http://host:port" under which the client addressed this server or the proxy in front of it; empty without a Host
// header.
std::string OriginOf(const Request& request) {
  if (request.fields->host.empty()) return {};
  return fmt::format("{}://{}", request.is_https ? "https" : "http", request.fields->host);
}

Response ServeTileJson(const HandlerState& state, const RequestContext& context,
                       const proto::TileJsonDescription& tiles) {
  Response response =
      Serve(Document::Make(proto::EncodeTileJson(tiles), "application/json"), *context.request, kRevalidate);
  response.vary_more = state.origin_headers;
  return response;
}

}  // namespace

Answer AnswerTileJson(const HandlerState& state, const RequestContext& context) {
  const Result<std::uint32_t> index = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!index) return ClientErrorResponse(index.error(), context.request->id);
  const Result<HeightTileParameters> parameters = ParseHeightTileParameters(context.route.query);
  if (!parameters) return ClientErrorResponse(parameters.error(), context.request->id);
  const DatasetView& dataset = state.catalog->datasets[*index];
  if (const auto has = CheckHasFormat(dataset, tiler::TileFormat::kHeightPng); !has) {
    return ClientErrorResponse(has.error(), context.request->id);
  }
  const std::string tile_query = HeightTileQuery(dataset, *parameters);
  const auto has_kind = CheckHasQueriedTiles(dataset, tiler::TileFormat::kHeightPng, tile_query);
  if (!has_kind) return ClientErrorResponse(has_kind.error(), context.request->id);
  proto::TileJsonDescription tiles;
  tiles.name = dataset.name;
  tiles.attribution = dataset.attribution;
  tiles.tile_template = fmt::format("{}/{}/{{z}}/{{x}}/{{y}}.png?{}", OriginOf(*context.request),
                                    PercentEncode(dataset.name), WithToken(tile_query, context));
  tiles.min_zoom = MinHeightTileLevel(dataset, parameters->size);
  tiles.max_zoom = MaxHeightTileLevel(dataset, parameters->size);
  tiles.tile_size = parameters->size;
  tiles.encoding = parameters->encoding;
  tiles.bounds = dataset.height_tile_bounds.value_or(dataset.bounds);
  return ServeTileJson(state, context, tiles);
}

Answer AnswerMapTileJson(const HandlerState& state, const RequestContext& context) {
  const auto refuse = [&](const Error& error) { return ClientErrorResponse(error, context.request->id); };
  const Result<std::uint32_t> index = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!index) return refuse(index.error());
  const DatasetView& dataset = state.catalog->datasets[*index];
  const TileFormatRow* row = context.route.format;
  if (const auto has = CheckHasFormat(dataset, row->format); !has) return refuse(has.error());
  if (const auto has = CheckHasImagery(dataset, row->format); !has) return refuse(has.error());
  const auto parameters = ParseMapParameters(context.route.query, row->format, /*in_tile_json=*/true);
  if (!parameters) return refuse(parameters.error());
  if (parameters->picture) row = FormatWith(row->format, *parameters->picture);
  if (row == nullptr) {
    return refuse({ErrorCode::kInvalidArgument, "the tiles of this layer do not have this format"});
  }
  const bool is_lines = row->format == tiler::TileFormat::kContours;
  proto::TileJsonDescription tiles;
  tiles.kind = is_lines ? proto::TileJsonKind::kContours : proto::TileJsonKind::kPictures;
  tiles.format = is_lines ? "pbf" : proto::ToString(row->picture);
  tiles.name = fmt::format("{} {}", dataset.name, row->folder);
  const bool has_own = row->format == tiler::TileFormat::kImagery && !dataset.imagery_attribution.empty();
  tiles.attribution = has_own ? dataset.imagery_attribution : dataset.attribution;
  const std::string query = fmt::format("v={}{}", dataset.version(), MapTileQuery(*parameters));
  tiles.tile_template = fmt::format("{}/{}/{}/{{z}}/{{x}}/{{y}}{}?{}", OriginOf(*context.request),
                                    PercentEncode(dataset.name), row->folder, row->suffix, WithToken(query, context));
  tiles.max_zoom = MaxMapLevel(dataset, row->format, parameters->size);
  tiles.min_zoom = MinMapLevel(*parameters);
  if (tiles.min_zoom > tiles.max_zoom) {
    return refuse(
        {ErrorCode::kInvalidArgument, fmt::format("interval must be at least {} m at the finest level, {}",
                                                  tiler::MinIntervalCm(tiles.max_zoom) / 100.0, tiles.max_zoom)});
  }
  tiles.tile_size = parameters->size;
  tiles.bounds = MapBounds(dataset, row->format);
  return ServeTileJson(state, context, tiles);
}

}  // namespace terrace::server
