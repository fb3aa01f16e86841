// The interface of an archive of baked tiles. archive/ implements it.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/tile_key.h"
#include "proto/gltf/gltf_types.h"
#include "tiler/tile/coding.h"
#include "tiler/tile/encoded_tile.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

// What documents say of a dataset, with sources or without.
struct DatasetExtent {
  std::vector<std::vector<geo::TileRange>> available;  // by level, from 0; the deepest served level is the last
  dem::GeoBounds bounds;
  dem::HeightRange heights;                     // of the data
  double floor_m = 0;                           // height where there is no data
  bool has_datum = true;                        // the vertical datum of its heights is known
  std::size_t sources = 1;                      // rasters that the heights come from
  bool has_water = false;                       // tiles have a water mask
  int metadata_availability = 0;                // tiles at multiples of this level have metadata; 0: none
  std::optional<proto::TextureFormat> texture;  // of GLB tiles, for requests that name none; nothing: no imagery
};

// The extent of a dataset without sources.
struct BakedExtent : DatasetExtent {
  std::vector<TileFormat> formats;  // of the tiles in the archive
  int max_source_level = 0;         // of the baked dataset without edits (dem::ElevationModel::max_source_level)
  int min_mercator_depth = 0, max_mercator_depth = 0;  // of the height tiles in the archive
  dem::GeoBounds height_tile_bounds;                   // of these tiles, within `bounds`
  bool normals = false;                                // quantized-mesh tiles have them
  std::vector<int> error_steps;                        // of tiles with a mesh, by level; empty: 0
};

// Thread-safe. Find and RangeBound may block on a disk or a network; the others return at once.
class BakedTiles {
 public:
  virtual ~BakedTiles() = default;

  // The coding that most tiles are kept in; other codings cost a decompression and perhaps a compression.
  virtual Coding coding() const = 0;
  virtual const BakedExtent& extent() const = 0;

  // The bytes that TilePipeline::Build gives for the request. Nothing: they were not baked. kUnavailable: a file is
  // damaged or cannot be read; the message names it.
  virtual Result<std::optional<EncodedTile>> Find(const TileRequest& request) const = 0;

  // Whether tiles of the request's level with its error, compression, texture, encoding and size were baked. Of the
  // key, only the level counts.
  virtual bool HasKind(const TileRequest& request) const = 0;

  // ElevationModel::RangeBound of a baked tile; for other tiles the range of the dataset. Errors: those of Find.
  virtual Result<dem::HeightRange> RangeBound(const geo::TileKey& key) const = 0;

  // Whether files are known to be missing, of another bake, or not readable: the archive has to be opened again.
  virtual bool is_outdated() const = 0;

  // Why Find finds nothing for a request: kNotFound.
  virtual Error WhyAbsent(const TileRequest& request) const = 0;
};

}  // namespace terrace::tiler
