// HTTP content types and extensions of quantized-mesh. Pure functions of header texts; thread-safe. Malformed input is
// no error; it requests nothing.
#pragma once

#include <string_view>

#include "proto/tile_extensions.h"

namespace terrace::proto {

// "octvertexnormals-metadata", the value of the `extensions` query parameter (cesium-native); unknown names are
// ignored.
TileExtensions ParseExtensions(std::string_view names);

// The extensions in the `extensions` parameter of an Accept header, for any media range: CesiumJS adds it to
// application/vnd.quantized-mesh, 3DTilesRendererJS to application/octet-stream.
TileExtensions ExtensionsInAccept(std::string_view accept);

// The Content-Type of a quantized-mesh tile with these extensions: a literal.
std::string_view QuantizedMeshContentType(TileExtensions extensions);

}  // namespace terrace::proto
