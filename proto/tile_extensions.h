// The extensions that a quantized-mesh tile may have.
#pragma once

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

}  // namespace terrace::proto
