#include "server/api/caching.h"

#include "server/http/text.h"
#include "tiler/encoder_version.h"

namespace terrace::server {

std::string_view CacheControlOf(std::string_view query, const DatasetView& dataset, std::string_view unversioned) {
  while (!query.empty()) {
    const std::string_view parameter = NextPiece(query, '&', /*blanks=*/"");
    if (parameter == "v") return "no-store";
    if (!parameter.starts_with("v=")) continue;
    return tiler::IsVersionOf(parameter.substr(2), dataset.generation) ? "public, max-age=31536000, immutable"
                                                                       : "no-store";
  }
  return unversioned;
}

}  // namespace terrace::server
