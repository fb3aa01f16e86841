// A tile request in canonical form: exactly the parameters that change the bytes.
#pragma once

#include <array>
#include <cstdint>

#include "engine/geo/tile_key.h"
#include "proto/documents/picture_types.h"
#include "proto/gltf/gltf_types.h"
#include "proto/tile_extensions.h"
#include "tiler/map/map_parameters.h"
#include "tiler/tile/coding.h"

namespace terrace::tiler {

enum class TileFormat : std::uint8_t {
  kQuantizedMesh,
  kGlb,
  kHeightPng,
  // Tiles for maps, which archives do not have.
  kHillshade,
  kSlope,
  kContours,
  kImagery,
  kGeodeticImagery
};

// Whether keys are in Web Mercator's XYZ scheme, y from the NORTH; else in TMS geodetic.
constexpr bool IsMercator(TileFormat format) {
  return format == TileFormat::kHeightPng || format == TileFormat::kHillshade || format == TileFormat::kSlope ||
         format == TileFormat::kContours || format == TileFormat::kImagery;
}
constexpr bool IsMapLayer(TileFormat format) { return format > TileFormat::kHeightPng; }

// Pixels along an edge of a height tile or of a picture for maps; the first is the default.
inline constexpr std::array<int, 2> kSidesPx = {256, 512};

// Members that the format does not use must have their defaults; otherwise caches keep the tile more than once.
struct TileRequest {
  std::uint32_t dataset = 0;  // index into TilePipeline::datasets()
  geo::TileKey key;
  // kQuantizedMesh and kGlb only: on the ladder of the key's level, kCoarsestStep .. kFinestStep (geo/error_ladder.h).
  int error_step = 0;
  TileFormat format = TileFormat::kQuantizedMesh;
  proto::GlbCompression compression = proto::GlbCompression::kDraco;  // kGlb only
  // kGlb only; no effect without an image. In a dataset without sources, it must be the texture of the archive's tiles.
  proto::TextureFormat texture = proto::TextureFormat::kNone;
  Coding coding = Coding::kIdentity;
  // kQuantizedMesh only: the extensions that are wanted. A tile made from sources lacks those that the dataset does not
  // have for it. In a dataset without sources, the archive's tile must have all of them.
  proto::TileExtensions extensions;
  proto::HeightEncoding height_encoding = proto::HeightEncoding::kMapbox;  // kHeightPng only
  // Pixels along an edge, of kHeightPng and of all map layers but kContours. In Web Mercator, tiles of 256 pixels have
  // the depth key.level (ElevationModel::ReadMercator), tiles of 512 pixels the depth key.level + 1.
  int side_px = kSidesPx[0];
  MapParameters map;  // IsMapLayer(format)

  friend bool operator==(const TileRequest&, const TileRequest&) = default;
};

struct TileRequestHash {
  std::size_t operator()(const TileRequest& request) const noexcept;
};

}  // namespace terrace::tiler
