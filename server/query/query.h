// The query part of a URL, and numbers in it.
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

// Undoes percent-encoding once; nothing where a '%' is not followed by two hexadecimal digits, or encodes a control
// character. '+' stays '+'.
std::optional<std::string> PercentDecode(std::string_view text);

// name -> value in the order sent, as ReadForm tells them.
using QueryParameters = std::vector<std::pair<std::string, std::string>>;

// Of a URL, which is short. Errors: those of ReadForm.
Result<QueryParameters> ParseQuery(std::string_view query);

// What a client may say about the geometric error, all of it optional.
struct RequestedError {
  std::optional<double> error_m;   // finite, > 0
  std::optional<double> fraction;  // of the level's error; finite, > 0
  bool at_least = false;           // error_m is a floor under the default errors
};

struct TileParameters {
  RequestedError requested;
  std::vector<std::string> extensions;  // every `extensions` value
  std::optional<proto::GlbCompression> compression;
  std::optional<proto::TextureFormat> texture;
};

// The parameters of tile URLs (`allow_at_least`), among them those of .glb (`allow_compression`), and of layer.json.
// `v` and `extensions` may come any number of times: clients append them on their own. deck.gl appends the query of
// tileset.json to every URL under it, so error, fraction, compression and texture may come again there with the same
// value. kInvalidArgument, with a message for the client: an unknown or repeated parameter, error and fraction
// together, atleast without error, or a value that is not what the parameter takes.
Result<TileParameters> ParseTileParameters(std::string_view query, bool allow_at_least, bool allow_compression = false);

struct HeightTileParameters {
  proto::HeightEncoding encoding = proto::HeightEncoding::kMapbox;
  int size = tiler::kHeightSizes[0];
};

// `encoding` and `size`, of height tiles and of the TileJSON that describes them. `v` may come any number of times.
Result<HeightTileParameters> ParseHeightTileParameters(std::string_view query);

// For URLs that take no parameters but `v`.
Result<void> RefuseParameters(std::string_view query);

}  // namespace terrace::server
