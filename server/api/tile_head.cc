#include "server/api/tile_head.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <string_view>

#include "proto/error_text.h"
#include "server/api/tile_formats.h"

namespace terrace::server {
tiler::HeadLines MakeTileHead(const tiler::TileRequest& request, const tiler::EncodedTile& tile) {
  tiler::HeadLines head;
  const auto put = [to = std::back_inserter(head.text)](std::string_view name, const auto& value) {
    fmt::format_to(to, "{}: {}\r\n", name, value);
  };
  put("Content-Type", RowOf(request.format).media_type(request));
  if (request.coding != tiler::Coding::kIdentity) put("Content-Encoding", tiler::NameOf(request.coding));
  put("Content-Length", tile.bytes.size());
  head.of_body = head.text.size();
  if (!tile.etag.empty()) put("ETag", tile.etag);
  put("Terrain-Max-Error", proto::FormatErrorUp(tile.max_error_m));
  if (tile.certified_error_m && std::isfinite(*tile.certified_error_m)) {
    put("Terrain-Certified-Error", proto::FormatErrorUp(*tile.certified_error_m));
  }
  head.text.shrink_to_fit();
  return head;
}

}  // namespace terrace::server
