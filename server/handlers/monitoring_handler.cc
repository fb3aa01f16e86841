#include <fmt/format.h>

#include <utility>

#include "server/handlers/handlers.h"
#include "server/http/http_error.h"
#include "server/http/text.h"

namespace terrace::server {

Response StateResponse(int status, std::string_view content_type, Body text) {
  Response response;
  response.status = status;
  response.is_vital = true;
  response.content_type = content_type;
  response.body = std::move(text);
  response.cache_control = "no-store";
  return response;
}

namespace {

constexpr const char* kPendingRetryAfter = "5";

Response PlainState(int status, std::string text) {
  return StateResponse(status, "text/plain; charset=utf-8", std::make_shared<const std::string>(std::move(text)));
}

asio::awaitable<Response> WriteMetrics(const ServerStatus& process) {
  std::shared_ptr<const std::string> text = co_await process.MetricsText();
  co_return StateResponse(200, kMetricsType, std::move(text));
}

}  // namespace

Answer AnswerLive(const HandlerState&, const RequestContext& context) {
  const Result<void> none = RefuseParameters(context.route.query);
  return none ? PlainState(200, "ok\n") : ClientErrorResponse(none.error(), context.request->id);
}

Response PendingResponse(const PendingDataset& dataset, std::string_view request_id) {
  Response response = ProblemResponse(
      503,
      dataset.has_failed ? "this dataset is not served yet: it cannot be opened as its files are now"
                         : fmt::format("this dataset is being prepared: {} % of its sources is read", dataset.percent),
      request_id);
  response.headers.emplace_back("Retry-After", kPendingRetryAfter);
  return response;
}

// The first word is the state. Without a dataset there is nothing to answer from. A degraded server still answers, so
// it should stay in service. Reasons contain file names and go only to the log. Datasets are named only to clients that
// may see all of them.
Answer AnswerReady(const HandlerState& state, const RequestContext& context) {
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  if (state.process.draining() || state.process.opening()) {
    Response response = PlainState(503, state.process.draining() ? "draining\n" : "opening\n");
    response.headers.emplace_back("Retry-After", kPendingRetryAfter);
    return response;
  }
  const std::map<std::string, std::string> problems = state.process.problems();
  const std::vector<PendingDataset> pending = state.process.PendingOf(*state.catalog);
  const bool is_opening = state.catalog->datasets.empty() && !pending.empty();
  std::string text = is_opening ? "opening\n" : problems.empty() && pending.empty() ? "ready\n" : "degraded\n";
  for (const auto& [dataset, reason] : problems) {
    if (dataset == kCacheProblem) {
      // It names no file.
      text += fmt::format("cache_dir: {}; averages of sources are kept in memory as far as they fit\n", reason);
    } else if (dataset.empty()) {
      text += "the configuration file is wrong, the last good one is in force\n";
    } else {
      const bool names_files = reason != kReopening && reason != kArchiveFault;
      text += fmt::format("dataset{}: {}\n", context.sees_all() ? " " + dataset : "",
                          names_files ? "cannot be opened as its files are now; the log has the reason" : reason);
    }
  }
  for (const PendingDataset& dataset : pending) {
    if (dataset.has_failed) continue;  // above
    text +=
        fmt::format("dataset{}: being prepared, {} %\n", context.sees_all() ? " " + dataset.name : "", dataset.percent);
  }
  Response response = PlainState(is_opening ? 503 : 200, std::move(text));
  if (is_opening) response.headers.emplace_back("Retry-After", kPendingRetryAfter);
  return response;
}

Answer AnswerMetrics(const HandlerState& state, const RequestContext& context) {
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  return WriteMetrics(state.process);
}

}  // namespace terrace::server
