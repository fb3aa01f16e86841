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

Response PlainState(int status, std::string text) {
  return StateResponse(status, "text/plain; charset=utf-8", std::make_shared<const std::string>(std::move(text)));
}

asio::awaitable<Response> WriteMetrics(const ProcessState& process) {
  std::shared_ptr<const std::string> text = co_await process.MetricsText();
  co_return StateResponse(200, kMetricsType, std::move(text));
}

}  // namespace

Answer AnswerLive(const Handlers&, const RequestContext& context) {
  const Result<void> none = RefuseParameters(context.route.query);
  return none ? PlainState(200, "ok\n") : ClientErrorResponse(none.error(), context.request->id);
}

// The first word is the state. A degraded server still answers, so it should stay in service. Reasons contain file
// names and go only to the log. Datasets are named only to clients that may see all of them.
Answer AnswerReady(const Handlers& from, const RequestContext& context) {
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  if (from.process.draining() || from.process.opening()) {
    Response response = PlainState(503, from.process.draining() ? "draining\n" : "opening\n");
    response.headers.emplace_back("Retry-After", "5");
    return response;
  }
  const std::map<std::string, std::string> problems = from.process.problems();
  std::string text = problems.empty() ? "ready\n" : "degraded\n";
  for (const auto& [dataset, reason] : problems) {
    if (dataset == kCacheProblem) {
      // It names no file.
      text += fmt::format("cache_dir: {}; averages of sources are kept in memory as far as they fit\n", reason);
    } else if (dataset.empty()) {
      text += "the configuration file is wrong, the last good one is in force\n";
    } else {
      text +=
          fmt::format("dataset{}: its source cannot be opened as it is now\n", context.sees_all() ? " " + dataset : "");
    }
  }
  return PlainState(200, std::move(text));
}

Answer AnswerMetrics(const Handlers& from, const RequestContext& context) {
  if (const Result<void> none = RefuseParameters(context.route.query); !none) {
    return ClientErrorResponse(none.error(), context.request->id);
  }
  return WriteMetrics(from.process);
}

}  // namespace terrace::server
