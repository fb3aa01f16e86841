// Parsed parameters of URLs of tiles. Pure.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/core/result.h"
#include "engine/geo/error_ladder.h"
#include "proto/gltf/glb_tile.h"
#include "proto/gltf/texture.h"
#include "tiler/tile/tile_request.h"

namespace terrace::server {

struct TileParameters {
  geo::RequestedError requested;
  std::vector<std::string> extensions;  // every `extensions` value
  std::optional<proto::GlbCompression> compression;
  std::optional<proto::TextureFormat> texture;
};

// Parses the query of tiles, layer.json, tileset.json and subtrees. `allow_at_least`: `atleast` is known.
// `allow_compression` (GLB tiles, tileset.json and subtrees): `compression` and `texture` are known. `v` (a
// dataset's version, ignored here) and `extensions` may be repeated, because clients append them. With
// `allow_compression`, error, fraction, compression and texture may be repeated with the same value, because deck.gl
// appends the query of tileset.json to every URL below it. kInvalidArgument, with a message for the client: an unknown
// or repeated parameter, error and fraction together, atleast without error, or an invalid value.
Result<TileParameters> ParseTileParameters(std::string_view query, bool allow_at_least, bool allow_compression = false);

struct HeightTileParameters {
  proto::HeightEncoding encoding = proto::HeightEncoding::kMapbox;
  int size = tiler::kSidesPx[0];
};

// Parses `encoding` and `size` of height tiles and of their TileJSON. `v` may be repeated. kInvalidArgument, with a
// message for the client: an unknown or repeated parameter, or an invalid value.
Result<HeightTileParameters> ParseHeightTileParameters(std::string_view query);

// The pixels along an edge of a Web Mercator tile. kInvalidArgument: not one of tiler::kSidesPx.
Result<void> SetTileSize(int& size, std::string_view text);

}  // namespace terrace::server
