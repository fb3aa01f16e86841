// The query part of a URL and its parameters.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "proto/gltf/glb_tile.h"
#include "proto/gltf/texture.h"
#include "tiler/tile_request.h"

namespace terrace::server {

// Decodes percent-encoding once. Nothing if a '%' is not followed by two hexadecimal digits or encodes a control
// character. '+' stays '+'.
std::optional<std::string> PercentDecode(std::string_view text);

// Names and values in the order sent, as decoded by ReadForm.
using QueryParameters = std::vector<std::pair<std::string, std::string>>;

// Parses the query of a URL. Errors: those of ReadForm.
Result<QueryParameters> ParseQuery(std::string_view query);

// The geometric error that a client requests; all members are optional.
struct RequestedError {
  std::optional<double> error_m;   // finite, > 0
  std::optional<double> fraction;  // of the level's error; finite, > 0
  bool at_least = false;           // error_m is the minimum of the default errors
};

struct TileParameters {
  RequestedError requested;
  std::vector<std::string> extensions;  // every `extensions` value
  std::optional<proto::GlbCompression> compression;
  std::optional<proto::TextureFormat> texture;
};

// Parses the parameters of URLs of tiles (`allow_at_least`), of .glb tiles (`allow_compression`) and of layer.json. `v`
// and `extensions` may be repeated, because clients append them. deck.gl appends the query of tileset.json to every URL
// below it, so error, fraction, compression and texture may be repeated there with the same value. kInvalidArgument,
// with a message for the client: an unknown or repeated parameter, error and fraction together, atleast without error,
// or an invalid value.
Result<TileParameters> ParseTileParameters(std::string_view query, bool allow_at_least, bool allow_compression = false);

struct HeightTileParameters {
  proto::HeightEncoding encoding = proto::HeightEncoding::kMapbox;
  int size = tiler::kHeightSizes[0];
};

// Parses `encoding` and `size` of height tiles and of their TileJSON. `v` may be repeated.
Result<HeightTileParameters> ParseHeightTileParameters(std::string_view query);

// For URLs that have no parameters except `v`.
Result<void> RefuseParameters(std::string_view query);

}  // namespace terrace::server
