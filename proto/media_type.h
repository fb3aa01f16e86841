// HTTP content types and extensions of quantized-mesh. Pure functions of header texts; thread-safe. Malformed input is
// no error; it requests nothing.
#pragma once

#include <string_view>

namespace terrace::proto {

// Extensions of quantized-mesh-1.0.
struct TileExtensions {
  bool normals = false;     // extension 1, octvertexnormals
  bool water_mask = false;  // extension 2, watermask
  bool metadata = false;    // extension 4, metadata

  friend bool operator==(const TileExtensions&, const TileExtensions&) = default;
  friend TileExtensions operator|(TileExtensions a, TileExtensions b) {
    return {a.normals || b.normals, a.water_mask || b.water_mask, a.metadata || b.metadata};
  }
};

// "octvertexnormals-metadata", the value of the `extensions` query parameter (cesium-native); unknown names are
// ignored.
TileExtensions ParseExtensions(std::string_view names);

// The extensions in the `extensions` parameter of an Accept header, for any media range: CesiumJS adds it to
// application/vnd.quantized-mesh, 3DTilesRendererJS to application/octet-stream.
TileExtensions ExtensionsInAccept(std::string_view accept);

// The Content-Type of a quantized-mesh tile with these extensions: a literal.
std::string_view QuantizedMeshContentType(TileExtensions extensions);

}  // namespace terrace::proto
