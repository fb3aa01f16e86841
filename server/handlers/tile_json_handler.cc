#include <fmt/format.h>

#include <utility>

#include "proto/documents/tile_json.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/documents/document.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"

namespace terrace::server {
namespace {

// Default parameters are omitted, so that a tile has one URL.
std::string HeightTileQuery(const DatasetView& dataset, const HeightTileParameters& parameters) {
  std::string query = "v=" + dataset.version();
  const auto add = [&query](const std::string& text) { query += "&" + text; };
  const HeightTileParameters defaults;
  if (parameters.encoding != defaults.encoding) add(fmt::format("encoding={}", proto::ToString(parameters.encoding)));
  if (parameters.size != defaults.size) add(fmt::format("size={}", parameters.size));
  return query;
}

// "http://host:port" under which the client addressed this server or the proxy in front of it; empty without a Host
// header.
std::string OriginOf(const Request& request) {
  if (request.fields->host.empty()) return {};
  return fmt::format("{}://{}", request.is_https ? "https" : "http", request.fields->host);
}

}  // namespace

Answer AnswerTileJson(const Handlers& from, const RequestContext& context) {
  const Result<std::uint32_t> index = FindDataset(context.route.dataset, from.catalog->datasets);
  if (!index) return ClientErrorResponse(index.error(), context.request->id);
  const Result<HeightTileParameters> parameters = ParseHeightTileParameters(context.route.query);
  if (!parameters) return ClientErrorResponse(parameters.error(), context.request->id);
  const DatasetView& dataset = from.catalog->datasets[*index];
  if (const auto has = CheckHasFormat(dataset, tiler::TileFormat::kHeightPng); !has) {
    return ClientErrorResponse(has.error(), context.request->id);
  }
  proto::TileJsonDescription tiles;
  tiles.name = dataset.name;
  tiles.attribution = dataset.attribution;
  tiles.tile_template =
      fmt::format("{}/{}/{{z}}/{{x}}/{{y}}.png?{}", OriginOf(*context.request), PercentEncode(dataset.name),
                  WithToken(HeightTileQuery(dataset, *parameters), context));
  tiles.max_zoom = MaxHeightLevel(dataset, parameters->size);
  tiles.tile_size = parameters->size;
  tiles.encoding = parameters->encoding;
  tiles.west = dataset.west;
  tiles.south = dataset.south;
  tiles.east = dataset.east;
  tiles.north = dataset.north;
  Response response =
      Serve(Document::Make(proto::EncodeTileJson(tiles), "application/json"), *context.request, kRevalidate);
  response.vary_more = from.origin_headers;
  return response;
}

}  // namespace terrace::server
