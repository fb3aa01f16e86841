// The quantized-mesh-1.0 tile format (CesiumGS/quantized-mesh README): the encoder, and the reading of its own tiles.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "engine/geo/ellipsoid.h"
#include "engine/geo/tile_key.h"
#include "proto/mesh/water_mask.h"
#include "proto/tile_extensions.h"

namespace terrace::proto {

inline constexpr int kQuantizedMax = 32767;  // u, v and heights have 15 bits
// With at most this many vertices every client reads indices of 16 bits: in the format they have 32 bits from 65537
// vertices on, but CesiumJS reads 32 bits at 65536 already. The limit is one less than necessary.
inline constexpr std::size_t kMaxTileVertices = 65534;

// A quantized tile: integers, and the two heights of the header that scale them.
struct QuantizedTile {
  geo::TileKey key;
  std::vector<std::uint16_t> u;                         // 0 west .. 32767 east
  std::vector<std::uint16_t> v;                         // 0 south .. 32767 north
  std::vector<std::uint16_t> h;                         // 0 min_height .. 32767 max_height
  std::vector<std::array<std::uint32_t, 3>> triangles;  // counter-clockwise in (u, v)
  float min_height = 0;
  float max_height = 0;
  std::vector<std::array<std::uint8_t, 2>> normals;  // oct-encoded, ECEF, one per vertex
  WaterMask water_mask;
  std::string metadata;  // JSON (tile_metadata.h)
};

// Renumbers the vertices in order of first use, as high-water-mark coding requires, and lists the edges. Computes
// centre, bounding sphere and horizon occlusion point from the decoded vertices. Preconditions: at least 2 triangles,
// at most kMaxTileVertices vertices, all four edges complete; the tile has the `extensions`.
//
// `positions`: of the tile's vertices as clients decode them, ECEF.
std::string EncodeQuantizedMesh(const QuantizedTile& tile, const TileExtensions& extensions,
                                const std::vector<geo::Vec3>& positions);

// Decodes the mesh of a tile: header, vertices and triangles, without the lists of edges and the extensions. Nothing:
// one of these is incomplete or invalid, or there are more than kMaxTileVertices vertices. Keeps vertices without a
// triangle, and degenerate triangles of one point.
std::optional<QuantizedTile> ReadQuantizedMesh(std::string_view encoded, const geo::TileKey& key);

// Removes the extensions that `extensions` does not name. The result is what EncodeQuantizedMesh returns for these
// extensions. Nothing: `encoded` was not written by EncodeQuantizedMesh, or lacks an extension of `extensions`.
std::optional<std::string> KeepExtensions(std::string_view encoded, const TileExtensions& extensions);

}  // namespace terrace::proto
