#include "server/documents/document.h"

#include <fmt/format.h>

#include <utility>

#include "proto/compress.h"
#include "server/api/caching.h"
#include "server/api/tile_formats.h"
#include "server/http/http_error.h"
#include "tiler/tile/strong_etag.h"

namespace terrace::server {
namespace {

tiler::Coding CodingFor(const Request& request) {
  return NegotiateCoding(request.fields->accept_encoding, tiler::kGzipOnly);
}

std::string EtagOf(const DocumentPlan& plan, tiler::Coding coding) {
  return tiler::RequestETag("document", plan.key, *plan.generation, "", coding);
}

}  // namespace

Document Document::Make(std::string bytes, std::string_view content_type, std::optional<std::string> gzipped) {
  Document document;
  document.content_type = content_type;
  std::string compressed = gzipped ? std::move(*gzipped) : proto::Gzip(bytes);
  document.identity_etag = tiler::StrongETag(bytes);
  document.gzip_etag = tiler::StrongETag(compressed);
  if (compressed.size() < bytes.size()) document.gzip = std::make_shared<const std::string>(std::move(compressed));
  document.identity = std::make_shared<const std::string>(std::move(bytes));
  return document;
}

Response Serve(const Document& document, const Request& request, std::string_view cache_control) {
  const bool gzip = document.gzip && CodingFor(request) == tiler::Coding::kGzip;
  Response response;
  response.content_type = document.content_type;
  response.content_encoding = gzip ? tiler::NameOf(tiler::Coding::kGzip) : std::string_view();
  response.body = gzip ? document.gzip : document.identity;
  response.etag = gzip ? document.gzip_etag : document.identity_etag;
  response.cache_control = cache_control;
  if (document.gzip) response.vary = "Accept-Encoding";
  return Conditional(std::move(response), request);
}

Result<RenderedDocument> MakeDocument(const DocumentPlan::Write& write, tiler::Coding coding,
                                      const std::stop_token& stop) {
  DocumentText text = write(stop);
  RenderedDocument made;
  made.is_final = text.is_final;
  std::string& bytes = text.bytes;
  if (coding == tiler::Coding::kGzip) {
    std::string compressed = proto::Gzip(bytes, stop);
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

Response Serve(const RenderedDocument& made, const DocumentPlan& plan, const Request& request) {
  Response response;
  response.content_type = plan.content_type;
  response.content_encoding = tiler::NameOf(made.coding);
  response.body = made.body;
  response.etag = plan.generation && made.is_final ? EtagOf(plan, CodingFor(request)) : made.etag;
  response.cache_control = made.is_final ? plan.cache_control : kRevalidate;
  response.vary = "Accept-Encoding";
  response.depends_on_token = plan.depends_on_token;
  return Conditional(std::move(response), request);
}

DocumentMaker::DocumentMaker(CatalogPtr catalog, DocumentFlights& flights)
    : catalog_(std::move(catalog)), flights_(flights) {}

Answer DocumentMaker::Make(DocumentAnswer described, const RequestContext& context) const {
  auto* plan = std::get_if<DocumentPlan>(&described);
  if (plan == nullptr) return std::get<Response>(std::move(described));
  const tiler::Coding coding = CodingFor(*context.request);
  if (const auto kept = kept_.Find(Key{plan->key, coding})) return Serve(*kept, *plan, *context.request);
  if (plan->generation && NamesEtag(context.request->fields->if_none_match, EtagOf(*plan, coding))) {
    return Serve(RenderedDocument{std::make_shared<const std::string>(), coding, {}}, *plan, *context.request);
  }
  return MakeOnWorker(std::move(*plan), coding, context);
}

asio::awaitable<Response> DocumentMaker::MakeOnWorker(DocumentPlan plan, tiler::Coding coding,
                                                      const RequestContext& context) const {
  using DocumentPtr = std::shared_ptr<const RenderedDocument>;
  // The waiting request may end before the worker does.
  Work<DocumentPtr> work = [catalog = catalog_, write = plan.write,
                            coding](const std::stop_token& stop) -> Result<DocumentPtr> {
    Result<RenderedDocument> made = MakeDocument(write, coding, stop);
    if (!made) return tl::unexpected(std::move(made.error()));
    return std::make_shared<const RenderedDocument>(*std::move(made));
  };
  // The work holds the catalog, so no other one has its address meanwhile.
  std::string key = fmt::format("{} {} {}", fmt::ptr(catalog_.get()), tiler::NameOf(coding), plan.key);
  const JobTerms terms = ShortTerms(context.request->deadline, context.request->client);
  const Result<DocumentPtr> made =
      (co_await flights_.Join(std::move(key), "the document", std::move(work), terms)).value;
  if (!made) co_return co_await DelayedBackendError(made.error(), context.request->id);
  if ((*made)->is_final) kept_.Insert(Key{plan.key, coding}, *made);
  co_return Serve(**made, plan, *context.request);
}

}  // namespace terrace::server
