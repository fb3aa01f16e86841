#include <fmt/format.h>

#include <utility>

#include "proto/documents/layer_json.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"
#include "tiler/store/baked_tiles.h"

namespace terrace::server {
namespace {

std::string Print(double value) {
  std::string text = fmt::format("{}", value);
  std::erase(text, '+');
  return text;
}

std::string WriteLayer(const DatasetView& dataset, std::string tile_query, const std::stop_token& stop = {}) {
  proto::LayerDescription layer;
  layer.name = dataset.name;
  layer.version = dataset.version();
  layer.attribution = dataset.attribution;
  layer.available = dataset.available;
  layer.bounds = dataset.bounds;
  layer.water_mask = dataset.has_water;
  layer.metadata_availability = dataset.metadata_availability;
  if (dataset.only_archive) layer.normals = dataset.only_archive->extent().normals;
  layer.tile_query = std::move(tile_query);
  return proto::EncodeLayerJson(layer, stop);
}

}  // namespace

std::string TileQuery(const geo::RequestedError& requested) {
  if (requested.error_m) return fmt::format("error={}&atleast=1", Print(*requested.error_m));
  if (requested.fraction) return fmt::format("fraction={}", Print(*requested.fraction));
  return {};
}

const Grant* GrantInQuery(const RequestContext& context) {
  const bool has_name = context.grant && !context.grant->name.empty();
  return context.token_in_query && has_name ? context.grant.get() : nullptr;
}

std::string WithToken(std::string query, const RequestContext& context) {
  if (GrantInQuery(context) == nullptr) return query;
  return query + (query.empty() ? "" : "&") + "token=" + PercentEncode(context.token);
}

Document PlainLayer(const DatasetView& dataset) { return Document::Make(WriteLayer(dataset, ""), "application/json"); }

DocumentAnswer DescribeLayer(const HandlerState& state, const RequestContext& context) {
  const Result<std::uint32_t> dataset = FindDataset(context.route.dataset, state.catalog->datasets);
  if (!dataset) return ClientErrorResponse(dataset.error(), context.request->id);
  if (const auto has = CheckHasFormat(state.catalog->datasets[*dataset], tiler::TileFormat::kQuantizedMesh); !has) {
    return ClientErrorResponse(has.error(), context.request->id);
  }
  const Result<TileParameters> parameters = ParseTileParameters(context.route.query, /*allow_at_least=*/false);
  if (!parameters) return ClientErrorResponse(parameters.error(), context.request->id);
  const auto has_kind = CheckHasQueriedTiles(state.catalog->datasets[*dataset], tiler::TileFormat::kQuantizedMesh,
                                             TileQuery(parameters->requested));
  if (!has_kind) return ClientErrorResponse(has_kind.error(), context.request->id);
  std::string tile_query = WithToken(TileQuery(parameters->requested), context);
  if (tile_query.empty()) return Serve(state.dataset_documents[*dataset].layer, *context.request, kRevalidate);
  DocumentPlan plan;
  plan.key = fmt::format("layer {} {} {}", *dataset, TileQuery(parameters->requested), fmt::ptr(GrantInQuery(context)));
  plan.content_type = "application/json";
  plan.cache_control = kRevalidate;
  plan.write = [&view = state.catalog->datasets[*dataset], tile_query = std::move(tile_query)](
                   const std::stop_token& stop) { return WriteLayer(view, tile_query, stop); };
  return plan;
}

}  // namespace terrace::server
