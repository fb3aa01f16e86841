// What one tile request asks for, in canonical form: everything that changes the bytes and nothing else.
#pragma once

#include <cstdint>
#include <string>

#include "engine/geo/tile_key.h"
#include "proto/glb_tile.h"
#include "proto/texture.h"

namespace terrace::server {

enum class TileFormat : std::uint8_t { kQuantizedMesh, kGlb };
enum class Coding : std::uint8_t { kIdentity, kGzip };

struct TileRequest {
  std::uint32_t dataset = 0;  // index into the server's datasets
  geo::TileKey key;
  int error_step = 0;  // on the ladder of the key's level (engine/geo/error_ladder.h)
  TileFormat format = TileFormat::kQuantizedMesh;
  proto::GlbCompression compression = proto::GlbCompression::kDraco;  // kGlb only
  proto::TextureFormat texture = proto::TextureFormat::kNone;         // kGlb only
  Coding coding = Coding::kIdentity;
  // Extensions of quantized-mesh, each only where the client asks for it and the tile has it. GLB tiles always have
  // normals.
  bool normals = false;
  bool water_mask = false;
  bool metadata = false;

  friend bool operator==(const TileRequest&, const TileRequest&) = default;
};

struct TileRequestHash {
  std::size_t operator()(const TileRequest& request) const noexcept;
};

}  // namespace terrace::server
