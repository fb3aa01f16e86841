#include "server/api/caching.h"

#include "server/http/text.h"
#include "tiler/encoder_version.h"

namespace terrace::server {

std::string_view CacheControlOf(std::string_view query, const DatasetView& dataset, std::string_view unversioned,
                                bool is_covered) {
  while (!query.empty()) {
    const std::string_view parameter = NextPiece(query, '&', /*blanks=*/"");
    if (parameter == "v") return "no-store";
    if (!parameter.starts_with("v=")) continue;
    if (!tiler::IsVersionOf(parameter.substr(2), dataset.generation)) return "no-store";
    return is_covered ? "public, max-age=31536000, immutable" : unversioned;
  }
  return unversioned;
}

}  // namespace terrace::server
