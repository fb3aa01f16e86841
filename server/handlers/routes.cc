#include "server/handlers/routes.h"

#include <fmt/format.h>

#include <map>
#include <memory>
#include <utility>

#include "server/http/http_error.h"
#include "server/http/negotiate.h"

namespace terrace::server {
namespace {

// Files of the viewer change with the server: clients ask again, and usually hear 304.
constexpr std::string_view kRevalidate = "no-cache";

// What whoever operates the server asks it.
Response StateResponse(int status, std::string_view content_type, std::shared_ptr<const std::string> text) {
  Response response;
  response.status = status;
  response.is_vital = true;
  response.content_type = content_type;
  response.body = std::move(text);
  response.cache_control = "no-store";
  return response;
}

Response PlainState(int status, std::string text) {
  return StateResponse(status, "text/plain; charset=utf-8", std::make_shared<const std::string>(std::move(text)));
}

bool SeesAll(const Request& request) { return !request.grant || request.grant->sees_all; }

// The first word is the state. A degraded server goes on answering, so it is not to be taken out of service. Reasons
// name files: they are for the log. Datasets are named to those who may see them all.
Response Ready(const Routes::State& state, bool sees_all) {
  if (state.draining() || state.opening()) {
    Response response = PlainState(503, state.draining() ? "draining\n" : "opening\n");
    response.headers.emplace_back("Retry-After", "5");
    return response;
  }
  const std::map<std::string, std::string> troubles = state.troubles();
  std::string text = troubles.empty() ? "ready\n" : "degraded\n";
  for (const auto& [dataset, reason] : troubles) {
    text += dataset.empty()
                ? "the configuration file is wrong, the last good one is in force\n"
                : fmt::format("dataset{}: its source cannot be opened as it is now\n", sees_all ? " " + dataset : "");
  }
  return PlainState(200, std::move(text));
}

}  // namespace

Routes::Routes(CatalogPtr catalog, TileService& tiles, std::shared_ptr<const StaticFiles> viewer,
               TileHandlerOptions options, std::size_t max_locations, State state)
    : catalog_(std::move(catalog)),
      tiles_(catalog_, tiles, options),
      heights_(catalog_, tiles, options, max_locations),
      areas_(catalog_, tiles, options),
      layers_(catalog_->datasets, options.cache_control),
      tilesets_(catalog_->datasets, options.cache_control),
      tile_json_(catalog_->datasets, options.cache_control),
      viewer_(std::move(viewer)),
      datasets_(Document::Make(DatasetsJson(catalog_->datasets), "application/json")),
      index_(Document::Make(IndexHtml(catalog_->datasets), "text/html; charset=utf-8")),
      documents_(catalog_, tiles, options),
      state_(std::move(state)) {}

std::optional<Response> Routes::ServeAtOnce(const Route& route, const Request& request) const {
  if (route.kind == RouteKind::kHeights || route.kind == RouteKind::kMesh || route.kind == RouteKind::kMetrics) {
    return std::nullopt;
  }
  std::optional<Response> response;
  if (route.kind == RouteKind::kTile) {
    response = tiles_.HandleNow(route, request);
  } else {
    Answer answer = Describe(route, request);
    const auto* plan = std::get_if<DocumentPlan>(&answer);
    response = plan != nullptr ? documents_.ServeAtOnce(*plan, request) : std::get<Response>(std::move(answer));
  }
  if (response) Label(*response, route.kind, route.dataset);
  return response;
}

asio::awaitable<Response> Routes::Serve(Route route, Request request) const {
  const RouteKind kind = route.kind;
  const std::string dataset = route.dataset;
  Response response;
  if (kind == RouteKind::kTile) {
    response = co_await tiles_.Handle(std::move(route), std::move(request));
  } else if (kind == RouteKind::kHeights) {
    response = co_await heights_.Handle(std::move(route), std::move(request));
  } else if (kind == RouteKind::kMesh) {
    response = co_await areas_.Handle(std::move(route), std::move(request));
  } else if (kind == RouteKind::kMetrics) {
    response = co_await ServeMetrics(std::move(route), std::move(request));
  } else {
    Answer answer = Describe(route, request);
    if (auto* plan = std::get_if<DocumentPlan>(&answer)) {
      response = co_await documents_.Serve(std::move(*plan), std::move(request));
    } else {
      response = std::get<Response>(std::move(answer));
    }
  }
  Label(response, kind, dataset);
  co_return response;
}

asio::awaitable<Response> Routes::ServeMetrics(Route route, Request request) const {
  if (const Result<void> none = RefuseParameters(route.query); !none) {
    co_return ClientErrorResponse(none.error(), request.id);
  }
  std::shared_ptr<const std::string> text = co_await state_.metrics_text();
  co_return StateResponse(200, "text/plain; version=0.0.4; charset=utf-8", std::move(text));
}

// Names that nobody serves must not become labels of the metrics.
void Routes::Label(Response& response, RouteKind kind, const std::string& dataset) const {
  response.route = ToString(kind);
  if (!dataset.empty() && FindDataset(dataset, catalog_->datasets)) response.dataset = dataset;
}

Answer Routes::Describe(const Route& route, const Request& request) const {
  if (route.kind == RouteKind::kViewer) return DescribeViewer(route, request);
  if (route.kind == RouteKind::kLayer) return layers_.Handle(route, request);
  if (route.kind == RouteKind::kTileset) return tilesets_.Handle(route, request);
  if (route.kind == RouteKind::kSubtree) return tilesets_.HandleSubtree(route, request);
  if (route.kind == RouteKind::kTileJson) return tile_json_.Handle(route, request);
  if (const Result<void> none = RefuseParameters(route.query); !none) {
    return ClientErrorResponse(none.error(), request.id);
  }
  switch (route.kind) {
    case RouteKind::kDatasets:
      if (SeesAll(request)) return terrace::server::Serve(datasets_, request, kRevalidate);
      return PlanOfSeen(datasets_, request, DatasetsJson);
    case RouteKind::kReady:
      return Ready(state_, SeesAll(request));
    default:
      return PlainState(200, "ok\n");
  }
}

// What `write` makes of the datasets that the request may see; `all`: the same of all datasets.
DocumentPlan Routes::PlanOfSeen(const Document& all, const Request& request, WriteDatasets write) const {
  DocumentPlan plan;
  // There is one grant of each token, for as long as the server runs.
  plan.key = fmt::format("{} {}", all.identity_etag, fmt::ptr(request.grant.get()));
  plan.bytes = all.identity->size();
  plan.content_type = all.content_type;
  plan.cache_control = kRevalidate;
  plan.write = [&datasets = catalog_->datasets, grant = request.grant, write](const std::stop_token& stop) {
    return write(
        datasets, [&](const DatasetView& view) { return grant->Sees(view.name); }, stop);
  };
  return plan;
}

// Its pages keep their state in the query, so any query goes.
Answer Routes::DescribeViewer(const Route& route, const Request& request) const {
  if (const Document* file = viewer_->Find(route.file)) return terrace::server::Serve(*file, request, kRevalidate);
  if (viewer_->empty() && route.file == "index.html") {
    if (SeesAll(request)) {
      Response index = terrace::server::Serve(index_, request, kRevalidate);
      index.for_grant = request.grant != nullptr;
      return index;
    }
    DocumentPlan index = PlanOfSeen(index_, request, IndexHtml);
    index.for_grant = true;
    return index;
  }
  return ProblemResponse(404, "no such URL; /datasets lists those of each dataset", request.id);
}

}  // namespace terrace::server
