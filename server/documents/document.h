// A document that is prepared in advance, in both codings, with its ETags: layer.json, /datasets, the viewer's files.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "server/http/request.h"
#include "server/http/response.h"

namespace terrace::server {

struct Document {
  std::string_view content_type;  // a literal
  Body identity, gzip;            // gzip is null if it would not be smaller
  std::string identity_etag, gzip_etag;

  // `gzipped`: the same bytes, compressed beforehand.
  static Document Make(std::string bytes, std::string_view content_type,
                       std::optional<std::string> gzipped = std::nullopt);
};

// Returns the document in the coding that the request prefers; 304 if the client already has it.
Response Serve(const Document& document, const Request& request, std::string_view cache_control);

}  // namespace terrace::server
