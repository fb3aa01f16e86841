#include "server/handlers/tile_json_handler.h"

#include <fmt/format.h>

#include <utility>

#include "proto/documents/tile_json.h"
#include "server/api/negotiate.h"
#include "server/documents/document.h"
#include "server/handlers/datasets_handler.h"
#include "server/handlers/layer_handler.h"
#include "server/http/http_error.h"
#include "server/query/query.h"

namespace terrace::server {
namespace {

// Default parameters are omitted, so that a tile has one URL.
std::string HeightTileQuery(const HeightTileParameters& parameters) {
  std::string query;
  const auto add = [&query](std::string text) { query += (query.empty() ? "" : "&") + std::move(text); };
  const HeightTileParameters defaults;
  if (parameters.encoding != defaults.encoding) add(fmt::format("encoding={}", proto::ToString(parameters.encoding)));
  if (parameters.size != defaults.size) add(fmt::format("size={}", parameters.size));
  return query;
}

}  // namespace

TileJsonHandler::TileJsonHandler(std::span<const DatasetView> datasets, std::string cache_control)
    : datasets_(datasets), cache_control_(std::move(cache_control)) {}

Response TileJsonHandler::Handle(const Call& call) const {
  const Result<std::uint32_t> index = FindDataset(call.route.dataset, datasets_);
  if (!index) return ClientErrorResponse(index.error(), call.request->id);
  const Result<HeightTileParameters> parameters = ParseHeightTileParameters(call.route.query);
  if (!parameters) return ClientErrorResponse(parameters.error(), call.request->id);
  const DatasetView& dataset = datasets_[*index];
  proto::TileJsonDescription tiles;
  tiles.name = dataset.name;
  tiles.attribution = dataset.attribution;
  const std::string query = WithToken(HeightTileQuery(*parameters), call);
  tiles.tile_template = fmt::format("{}/{}/{{z}}/{{x}}/{{y}}.png{}{}", OriginOf(*call.request),
                                    PercentEncode(dataset.name), query.empty() ? "" : "?", query);
  tiles.max_zoom = MaxHeightLevel(dataset, parameters->size);
  tiles.tile_size = parameters->size;
  tiles.encoding = parameters->encoding;
  tiles.west = dataset.west;
  tiles.south = dataset.south;
  tiles.east = dataset.east;
  tiles.north = dataset.north;
  Response response =
      Serve(Document::Make(proto::EncodeTileJson(tiles), "application/json"), *call.request, cache_control_);
  response.vary_too =
      "Forwarded, X-Forwarded-Host, X-Forwarded-Proto";  // headers by which a proxy may change the origin
  return response;
}

std::string OriginOf(const Request& request) {
  if (request.fields->host.empty()) return {};
  return fmt::format("{}://{}", request.is_https ? "https" : "http", request.fields->host);
}

}  // namespace terrace::server
