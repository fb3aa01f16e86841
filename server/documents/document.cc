#include "server/documents/document.h"

#include <utility>

#include "proto/compress.h"
#include "server/api/negotiate.h"
#include "tiler/strong_etag.h"

namespace terrace::server {

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
  const bool gzip =
      document.gzip && NegotiateCoding(request.fields->accept_encoding, tiler::kGzipOnly) == tiler::Coding::kGzip;
  Response response;
  response.content_type = document.content_type;
  response.content_encoding = gzip ? tiler::NameOf(tiler::Coding::kGzip) : std::string_view();
  response.body = gzip ? document.gzip : document.identity;
  response.etag = gzip ? document.gzip_etag : document.identity_etag;
  response.cache_control = cache_control;
  if (document.gzip) response.vary = "Accept-Encoding";
  return Conditional(std::move(response), request);
}

}  // namespace terrace::server
