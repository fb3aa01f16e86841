#include "proto/mesh/quantized_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "proto/mesh/tile_geometry.h"
#include "proto/mesh/vertex_order.h"

namespace terrace::proto {
namespace {

constexpr std::size_t kHeaderBytes = 88;
constexpr std::uint8_t kOctVertexNormals = 1, kWaterMask = 2, kMetadata = 4;  // extension ids

// Indices are 16 bits wide up to 65,536 vertices, and all of them start on even offsets (88 + 4 + 6n), so that the
// format never needs padding here.
static_assert(kMaxTileVertices <= 65536);

void CheckPreconditions(const QuantizedTile& tile, const TileExtensions& extensions) {
  const std::size_t count = tile.u.size();
  TERRACE_CHECK(tile.v.size() == count && tile.h.size() == count && count <= kMaxTileVertices);
  TERRACE_CHECK(!extensions.normals || tile.normals.size() == count);
  constexpr std::size_t kWaterPixels = std::size_t{kWaterMaskSide} * kWaterMaskSide;
  TERRACE_CHECK(!extensions.water_mask || tile.water_mask.size() == 1 || tile.water_mask.size() == kWaterPixels);
  TERRACE_CHECK(!extensions.metadata || !tile.metadata.empty());
  TERRACE_CHECK(tile.triangles.size() >= 2);
  TERRACE_CHECK(geo::IsValid(tile.key));
  const auto fits = [](std::uint16_t value) { return value <= kQuantizedMax; };
  for (const auto* values : {&tile.u, &tile.v, &tile.h}) {
    TERRACE_CHECK(std::all_of(values->begin(), values->end(), fits));
  }
}

template <typename T>
std::vector<T> Reordered(const std::vector<T>& values, const std::vector<std::uint32_t>& old_index) {
  std::vector<T> out;
  out.reserve(old_index.size());
  for (std::uint32_t i : old_index) out.push_back(values[i]);
  return out;
}

void PutVec3(ByteWriter& out, geo::Vec3 v) {
  out.Put(v.x);
  out.Put(v.y);
  out.Put(v.z);
}

void PutHeader(ByteWriter& out, const QuantizedTile& tile, const std::vector<geo::Vec3>& positions) {
  const BoundingSphere sphere = EnclosingSphere(positions);
  // Clients make vertices relative to the sphere's centre and ignore the tile's; one value serves for both.
  PutVec3(out, sphere.center);
  out.Put(tile.min_height);
  out.Put(tile.max_height);
  PutVec3(out, sphere.center);
  out.Put(sphere.radius);
  PutVec3(out, HorizonOcclusionPoint(positions, sphere.center, tile.min_height));
  TERRACE_CHECK(out.size() == kHeaderBytes);
}

void PutAll(ByteWriter& out, const std::vector<std::uint16_t>& values) {
  out.PutBytes({reinterpret_cast<const char*>(values.data()), values.size() * sizeof(std::uint16_t)});
}

// Values have 15 bits, so their differences fit into 16 bits with sign.
void PutZigZagDeltas(ByteWriter& out, const std::vector<std::uint16_t>& values) {
  std::vector<std::uint16_t> deltas(values.size());
  int previous = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const int delta = values[i] - previous;
    deltas[i] = static_cast<std::uint16_t>((delta << 1) ^ (delta >> 31));
    previous = values[i];
  }
  PutAll(out, deltas);
}

// High-water-mark coding: each index is stored as its distance below the number of vertices so far; zero is a new
// vertex.
void PutTriangles(ByteWriter& out, const std::vector<std::array<std::uint32_t, 3>>& triangles) {
  out.Put(static_cast<std::uint32_t>(triangles.size()));
  std::vector<std::uint16_t> codes(3 * triangles.size());
  std::uint32_t high_water_mark = 0;
  auto to = codes.begin();
  for (const std::array<std::uint32_t, 3>& triangle : triangles) {
    for (std::uint32_t index : triangle) {
      const std::uint32_t code = high_water_mark - index;
      *to++ = static_cast<std::uint16_t>(code);
      high_water_mark += code == 0 ? 1 : 0;
    }
  }
  PutAll(out, codes);
}

// The vertices whose `across` is `edge`, sorted by `along`: clients build skirts from them in this order.
void PutEdge(ByteWriter& out, const std::vector<std::uint16_t>& across, int edge,
             const std::vector<std::uint16_t>& along) {
  std::vector<std::uint16_t> indices;
  for (std::size_t i = 0; i < across.size(); ++i) {
    if (across[i] == edge) indices.push_back(static_cast<std::uint16_t>(i));
  }
  TERRACE_CHECK(indices.size() >= 2);  // cesium-native computes size - 1 of an unsigned
  std::sort(indices.begin(), indices.end(), [&](std::uint16_t a, std::uint16_t b) { return along[a] < along[b]; });
  out.Put(static_cast<std::uint32_t>(indices.size()));
  PutAll(out, indices);
}

void PutNormals(ByteWriter& out, const std::vector<std::array<std::uint8_t, 2>>& normals) {
  out.Put(kOctVertexNormals);
  out.Put(static_cast<std::uint32_t>(2 * normals.size()));
  out.PutBytes({reinterpret_cast<const char*>(normals.data()), 2 * normals.size()});
}

void PutWaterMask(ByteWriter& out, const WaterMask& mask) {
  out.Put(kWaterMask);
  out.Put(static_cast<std::uint32_t>(mask.size()));
  out.PutBytes({reinterpret_cast<const char*>(mask.data()), mask.size()});
}

// The extension contains the length of its JSON.
void PutMetadata(ByteWriter& out, const std::string& json) {
  out.Put(kMetadata);
  out.Put(static_cast<std::uint32_t>(sizeof(std::uint32_t) + json.size()));
  out.Put(static_cast<std::uint32_t>(json.size()));
  out.PutBytes(json);
}

}  // namespace

std::string EncodeQuantizedMesh(const QuantizedTile& tile, const TileExtensions& extensions,
                                const std::vector<geo::Vec3>& positions) {
  CheckPreconditions(tile, extensions);
  TERRACE_CHECK(positions.size() == tile.u.size());
  VertexOrder order = OrderByFirstUse(tile.triangles, tile.u.size());
  QuantizedTile ordered;
  ordered.key = tile.key;
  ordered.min_height = tile.min_height;
  ordered.max_height = tile.max_height;
  ordered.u = Reordered(tile.u, order.old_index);
  ordered.v = Reordered(tile.v, order.old_index);
  ordered.h = Reordered(tile.h, order.old_index);
  ordered.triangles = std::move(order.triangles);
  if (extensions.normals) ordered.normals = Reordered(tile.normals, order.old_index);

  ByteWriter out;
  out.Reserve(kHeaderBytes + 64 + 9 * ordered.u.size() + 6 * ordered.triangles.size());
  PutHeader(out, ordered, Reordered(positions, order.old_index));
  out.Put(static_cast<std::uint32_t>(ordered.u.size()));
  PutZigZagDeltas(out, ordered.u);
  PutZigZagDeltas(out, ordered.v);
  PutZigZagDeltas(out, ordered.h);
  PutTriangles(out, ordered.triangles);
  PutEdge(out, ordered.u, 0, ordered.v);              // west
  PutEdge(out, ordered.v, 0, ordered.u);              // south
  PutEdge(out, ordered.u, kQuantizedMax, ordered.v);  // east
  PutEdge(out, ordered.v, kQuantizedMax, ordered.u);  // north
  if (extensions.normals) PutNormals(out, ordered.normals);
  if (extensions.water_mask) PutWaterMask(out, tile.water_mask);
  if (extensions.metadata) PutMetadata(out, tile.metadata);
  return out.Take();
}

std::optional<QuantizedTile> ReadQuantizedMesh(std::string_view encoded, const geo::TileKey& key) {
  ByteReader in(encoded);
  QuantizedTile tile;
  tile.key = key;
  in.GetBytes(3 * sizeof(double));  // the centre
  tile.min_height = in.Get<float>();
  tile.max_height = in.Get<float>();
  in.GetBytes(kHeaderBytes - 3 * sizeof(double) - 2 * sizeof(float));
  const std::size_t count = in.Get<std::uint32_t>();
  if (!in.ok() || count > kMaxTileVertices || !std::isfinite(tile.min_height) || !std::isfinite(tile.max_height)) {
    return std::nullopt;
  }
  for (std::vector<std::uint16_t>* const values : {&tile.u, &tile.v, &tile.h}) {
    int value = 0;
    for (std::size_t i = 0; i < count && in.ok(); ++i) {
      const int zigzag = in.Get<std::uint16_t>();
      value += (zigzag >> 1) ^ -(zigzag & 1);
      if (value < 0 || value > kQuantizedMax) return std::nullopt;
      values->push_back(static_cast<std::uint16_t>(value));
    }
  }
  const std::size_t triangles = in.Get<std::uint32_t>();
  std::uint32_t highest = 0;  // the high-water mark
  for (std::size_t t = 0; t < triangles && in.ok(); ++t) {
    auto& triangle = tile.triangles.emplace_back();
    for (std::uint32_t& corner : triangle) {
      const std::uint32_t code = in.Get<std::uint16_t>();
      if (code > highest || highest - code >= count) return std::nullopt;
      corner = highest - code;
      if (code == 0) ++highest;
    }
  }
  if (!in.ok()) return std::nullopt;
  return tile;
}

std::optional<std::string> KeepExtensions(std::string_view encoded, const TileExtensions& extensions) {
  ByteReader in(encoded);
  const auto skip_shorts = [&](std::size_t per_element) {
    const std::size_t count = in.Get<std::uint32_t>();
    in.GetBytes(count * per_element * sizeof(std::uint16_t));
  };
  in.GetBytes(kHeaderBytes);
  skip_shorts(3);  // u, v, h of the vertices
  skip_shorts(3);  // triangles
  for (int edge = 0; edge < 4; ++edge) skip_shorts(1);
  if (!in.ok()) return std::nullopt;

  const auto at = [&] { return encoded.size() - in.remaining(); };
  std::string kept(encoded.substr(0, at()));
  TileExtensions found;
  while (in.remaining() > 0) {
    const std::size_t start = at();
    const auto id = in.Get<std::uint8_t>();
    in.GetBytes(in.Get<std::uint32_t>());
    const bool normals = id == kOctVertexNormals && extensions.normals,
               water_mask = id == kWaterMask && extensions.water_mask,
               metadata = id == kMetadata && extensions.metadata;
    if (!in.ok() || !(normals || water_mask || metadata)) continue;
    kept.append(encoded.substr(start, at() - start));
    found.normals |= normals;
    found.water_mask |= water_mask;
    found.metadata |= metadata;
  }
  if (!in.ok() || found != extensions) return std::nullopt;
  return kept;
}

}  // namespace terrace::proto
