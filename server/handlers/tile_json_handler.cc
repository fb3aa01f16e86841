#include "server/handlers/tile_json_handler.h"

#include <fmt/format.h>

#include <utility>

#include "proto/documents/tile_json.h"
#include "server/api/caching.h"
#include "server/api/negotiate.h"
#include "server/documents/document.h"
#include "server/handlers/datasets_handler.h"
#include "server/handlers/layer_handler.h"
#include "server/http/http_error.h"
#include "server/query/query.h"

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

}  // namespace

TileJsonHandler::TileJsonHandler(std::span<const DatasetView> datasets, std::string_view origin_headers)
    : datasets_(datasets), origin_headers_(origin_headers) {}

Response TileJsonHandler::Handle(const Call& call) const {
  const Result<std::uint32_t> index = FindDataset(call.route.dataset, datasets_);
  if (!index) return ClientErrorResponse(index.error(), call.request->id);
  const Result<HeightTileParameters> parameters = ParseHeightTileParameters(call.route.query);
  if (!parameters) return ClientErrorResponse(parameters.error(), call.request->id);
  const DatasetView& dataset = datasets_[*index];
  proto::TileJsonDescription tiles;
  tiles.name = dataset.name;
  tiles.attribution = dataset.attribution;
  tiles.tile_template =
      fmt::format("{}/{}/{{z}}/{{x}}/{{y}}.png?{}", OriginOf(*call.request), PercentEncode(dataset.name),
                  WithToken(HeightTileQuery(dataset, *parameters), call));
  tiles.max_zoom = MaxHeightLevel(dataset, parameters->size);
  tiles.tile_size = parameters->size;
  tiles.encoding = parameters->encoding;
  tiles.west = dataset.west;
  tiles.south = dataset.south;
  tiles.east = dataset.east;
  tiles.north = dataset.north;
  Response response =
      Serve(Document::Make(proto::EncodeTileJson(tiles), "application/json"), *call.request, kRevalidate);
  response.vary_too = origin_headers_;
  return response;
}

std::string OriginOf(const Request& request) {
  if (request.fields->host.empty()) return {};
  return fmt::format("{}://{}", request.is_https ? "https" : "http", request.fields->host);
}

}  // namespace terrace::server
