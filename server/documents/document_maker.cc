#include "server/documents/document_maker.h"

#include <utility>

#include "proto/compress.h"
#include "server/api/backend_failure.h"
#include "server/api/negotiate.h"
#include "tiler/strong_etag.h"

namespace terrace::server {
namespace {

tiler::Coding CodingFor(const Request& request) {
  return NegotiateCoding(request.fields->accept_encoding, tiler::kGzipOnly);
}

}  // namespace

Result<MadeDocument> MakeDocument(const DocumentPlan::Write& write, tiler::Coding coding, const std::stop_token& stop) {
  std::string bytes = write(stop);
  MadeDocument made;
  if (coding == tiler::Coding::kGzip) {
    std::string compressed = proto::Gzip(bytes, proto::kGzipLevel, stop);
    if (compressed.size() < bytes.size()) {
      made.coding = tiler::Coding::kGzip;
      bytes = std::move(compressed);
    }
  }
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "nobody waits for the document any more");
  made.etag = tiler::StrongETag(bytes);
  made.body = std::make_shared<const std::string>(std::move(bytes));
  return made;
}

Response Serve(const MadeDocument& made, const DocumentPlan& plan, const Request& request) {
  Response response;
  response.content_type = plan.content_type;
  response.content_encoding = tiler::NameOf(made.coding);
  response.body = made.body;
  response.etag = made.etag;
  response.cache_control = plan.cache_control;
  response.vary = "Accept-Encoding";
  response.for_grant = plan.for_grant;
  return Conditional(std::move(response), request);
}

DocumentMaker::DocumentMaker(CatalogPtr catalog, TileService& workers, HandlerOptions options)
    : catalog_(std::move(catalog)), workers_(workers), options_(std::move(options)) {}

Answer DocumentMaker::Make(Described described, const Call& call) const {
  auto* plan = std::get_if<DocumentPlan>(&described);
  if (plan == nullptr) return std::get<Response>(std::move(described));
  const tiler::Coding coding = CodingFor(*call.request);
  if (const auto kept = kept_.Find(Key{plan->key, coding})) return Serve(*kept, *plan, *call.request);
  return MakeAside(std::move(*plan), coding, call);
}

asio::awaitable<Response> DocumentMaker::MakeAside(DocumentPlan plan, tiler::Coding coding, const Call& call) const {
  // The waiting request may end before the worker does.
  Work<MadeDocument> work = [catalog = catalog_, write = plan.write, coding](const std::stop_token& stop) {
    return MakeDocument(write, coding, stop);
  };
  const auto deadline = TileService::Clock::now() + options_.deadline;
  Result<MadeDocument> document =
      co_await workers_.Run(std::move(work), TileService::Length::kShort, deadline, call.request->client);
  if (!document) co_return co_await BackendFailure(document.error(), call.request->id, options_.refusal_delay);
  const auto made = std::make_shared<const MadeDocument>(*std::move(document));
  kept_.Insert(Key{plan.key, coding}, made);
  co_return Serve(*made, plan, *call.request);
}

}  // namespace terrace::server
