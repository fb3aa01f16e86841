#include "server/handlers/layer_handler.h"

#include <fmt/format.h>

#include <utility>

#include "proto/documents/layer_json.h"
#include "server/handlers/datasets_handler.h"
#include "server/http/http_error.h"
#include "server/http/negotiate.h"

namespace terrace::server {
namespace {

constexpr std::string_view kJson = "application/json";

std::string Print(double value) {
  std::string text = fmt::format("{}", value);
  std::erase(text, '+');
  return text;
}

std::string WriteLayer(const DatasetView& dataset, std::string tile_query, const std::stop_token& stop = {}) {
  proto::LayerDescription layer;
  layer.name = dataset.name;
  layer.attribution = dataset.attribution;
  layer.available = dataset.available;
  layer.west = dataset.west;
  layer.east = dataset.east;
  layer.south = dataset.south;
  layer.north = dataset.north;
  layer.water_mask = dataset.has_water;
  layer.metadata_levels = dataset.metadata_levels;
  layer.tile_query = std::move(tile_query);
  return proto::EncodeLayerJson(layer, stop);
}

}  // namespace

std::string TileQuery(const ErrorWish& wish) {
  if (wish.error_m) return fmt::format("error={}&atleast=1", Print(*wish.error_m));
  if (wish.fraction) return fmt::format("fraction={}", Print(*wish.fraction));
  return {};
}

const Grant* GrantInQuery(const Request& request) {
  const bool has_name = request.grant && !request.grant->name.empty();
  return request.token_in_query && has_name ? request.grant.get() : nullptr;
}

std::string WithToken(std::string query, const Request& request) {
  if (GrantInQuery(request) == nullptr) return query;
  return query + (query.empty() ? "" : "&") + "token=" + PercentEncode(request.token);
}

LayerHandler::LayerHandler(std::span<const DatasetView> datasets, std::string cache_control)
    : datasets_(datasets), cache_control_(std::move(cache_control)) {
  for (const DatasetView& dataset : datasets_) plain_.push_back(Document::Make(WriteLayer(dataset, ""), kJson));
}

Answer LayerHandler::Handle(const Route& route, const Request& request) const {
  const Result<std::uint32_t> dataset = FindDataset(route.dataset, datasets_);
  if (!dataset) return ClientErrorResponse(dataset.error(), request.id);
  const Result<TileParameters> parameters = ParseTileParameters(route.query, /*allow_at_least=*/false);
  if (!parameters) return ClientErrorResponse(parameters.error(), request.id);
  std::string tile_query = WithToken(TileQuery(parameters->wish), request);
  if (tile_query.empty()) return Serve(plain_[*dataset], request, cache_control_);
  DocumentPlan plan;
  plan.key = fmt::format("layer {} {} {}", *dataset, TileQuery(parameters->wish), fmt::ptr(GrantInQuery(request)));
  plan.bytes = plain_[*dataset].identity->size();
  plan.content_type = kJson;
  plan.cache_control = cache_control_;
  plan.write = [&view = datasets_[*dataset], tile_query = std::move(tile_query)](const std::stop_token& stop) {
    return WriteLayer(view, tile_query, stop);
  };
  return plan;
}

}  // namespace terrace::server
