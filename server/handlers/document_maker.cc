#include "server/handlers/document_maker.h"

#include <utility>

#include "proto/compress.h"
#include "server/handlers/backend_failure.h"
#include "server/http/negotiate.h"
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
  response.coding = made.coding;
  response.body = made.body;
  response.etag = made.etag;
  response.cache_control = plan.cache_control;
  response.vary = true;
  response.for_grant = plan.for_grant;
  return Conditional(std::move(response), request);
}

DocumentMaker::DocumentMaker(CatalogPtr catalog, TileService& workers, TileHandlerOptions options)
    : catalog_(std::move(catalog)), workers_(workers), options_(std::move(options)) {}

std::optional<Response> DocumentMaker::ServeAtOnce(const DocumentPlan& plan, const Request& request) const {
  const tiler::Coding coding = CodingFor(request);
  if (plan.bytes <= kShortBytes) return terrace::server::Serve(*MakeDocument(plan.write, coding, {}), plan, request);
  const std::shared_ptr<const MadeDocument> kept = kept_.Find(Key{plan.key, coding});
  if (!kept) return std::nullopt;
  return terrace::server::Serve(*kept, plan, request);
}

asio::awaitable<Response> DocumentMaker::Serve(DocumentPlan plan, Request request) const {
  // It may have been made since it was not there.
  if (std::optional<Response> now = ServeAtOnce(plan, request)) co_return *std::move(now);
  const tiler::Coding coding = CodingFor(request);
  const auto made = std::make_shared<MadeDocument>();
  // Whoever waits may leave before the worker does.
  SingleFlight::Work work = [catalog = catalog_, write = plan.write, coding,
                             made](const std::stop_token& stop) -> Result<tiler::EncodedTile> {
    Result<MadeDocument> document = MakeDocument(write, coding, stop);
    if (!document) return tl::unexpected(document.error());
    *made = *std::move(document);
    return tiler::EncodedTile();
  };
  const auto deadline = TileService::Clock::now() + options_.deadline;
  const Result<tiler::TilePtr> done =
      co_await workers_.Run(std::move(work), TileService::Length::kShort, deadline, request.client);
  if (!done) co_return co_await BackendFailure(done.error(), std::string(request.id), options_.refusal_delay);
  kept_.Insert(Key{plan.key, coding}, made);
  co_return terrace::server::Serve(*made, plan, request);
}

}  // namespace terrace::server
