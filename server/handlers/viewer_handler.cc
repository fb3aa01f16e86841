#include "server/handlers/viewer_handler.h"

#include <fmt/format.h>

#include <utility>

#include "server/api/caching.h"
#include "server/http/http_error.h"
#include "server/query/query.h"

namespace terrace::server {

ViewerHandler::ViewerHandler(std::span<const DatasetView> datasets, std::shared_ptr<const StaticFiles> files)
    : datasets_(datasets),
      files_(std::move(files)),
      list_(Document::Make(DatasetsJson(datasets_), "application/json")),
      index_(Document::Make(IndexHtml(datasets_), "text/html; charset=utf-8")) {}

Described ViewerHandler::Datasets(const Call& call) const {
  if (const Result<void> none = RefuseParameters(call.route.query); !none) {
    return ClientErrorResponse(none.error(), call.request->id);
  }
  if (call.sees_all()) return Serve(list_, *call.request, kRevalidate);
  return PlanOfSeen(list_, call, DatasetsJson);
}

// Pages keep their state in the query, so any query is allowed.
Described ViewerHandler::File(const Call& call) const {
  if (const Document* file = files_->Find(call.route.file)) return Serve(*file, *call.request, kRevalidate);
  if (files_->empty() && call.route.file == "index.html") {
    if (call.sees_all()) {
      Response index = Serve(index_, *call.request, kRevalidate);
      index.for_grant = call.grant != nullptr;
      return index;
    }
    DocumentPlan index = PlanOfSeen(index_, call, IndexHtml);
    index.for_grant = true;
    return index;
  }
  return ProblemResponse(404, "no such URL; /datasets lists those of each dataset", call.request->id);
}

// A plan to call `write` for the datasets that the client may see. `all`: the document of all datasets.
DocumentPlan ViewerHandler::PlanOfSeen(const Document& all, const Call& call, WriteDatasets write) const {
  DocumentPlan plan;
  // Each token has one Grant as long as the server runs.
  plan.key = fmt::format("{} {}", all.identity_etag, fmt::ptr(call.grant.get()));
  plan.content_type = all.content_type;
  plan.cache_control = kRevalidate;
  plan.write = [datasets = datasets_, grant = call.grant, write](const std::stop_token& stop) {
    return write(
        datasets, [&](const DatasetView& view) { return grant->Sees(view.name); }, stop);
  };
  return plan;
}

}  // namespace terrace::server
