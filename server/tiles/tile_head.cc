#include "server/tiles/tile_head.h"

#include <fmt/format.h>

#include <cmath>
#include <iterator>
#include <string_view>

#include "proto/error_text.h"
#include "proto/media_type.h"

namespace terrace::server {
namespace {

std::string_view ContentTypeOf(const tiler::TileRequest& tile) {
  if (tile.format == tiler::TileFormat::kGlb) return "model/gltf-binary";
  if (tile.format == tiler::TileFormat::kHeightPng) return "image/png";
  return proto::QuantizedMeshContentType({tile.normals, tile.water_mask, tile.metadata});
}

}  // namespace

tiler::HeadLines MakeTileHead(const tiler::TileRequest& request, const tiler::EncodedTile& tile) {
  tiler::HeadLines head;
  const auto put = [to = std::back_inserter(head.text)](std::string_view name, const auto& value) {
    fmt::format_to(to, "{}: {}\r\n", name, value);
  };
  put("Content-Type", ContentTypeOf(request));
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
