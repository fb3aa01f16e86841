// A dataset: its sources or its archive, and the options of its tiles.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/common/file_stamp.h"
#include "engine/dem/elevation_model.h"
#include "engine/geo/error_ladder.h"
#include "engine/image/imagery.h"
#include "engine/image/water_raster.h"
#include "proto/gltf/glb_options.h"
#include "tiler/mesh/mesh_options.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

class BakedTiles;  // an archive of baked tiles: tiler/store/baked_tiles.h, which is not installed

// The source of a dataset's water: a mask, a sea level, or none. At most one is set.
struct WaterOptions {
  std::shared_ptr<const dem::WaterRaster> mask;
  std::optional<double> sea_level_m;  // in the vertical datum of each source

  bool any() const { return mask != nullptr || sea_level_m.has_value(); }
};

// The image of the textures of GLB tiles and of image tiles for maps. `texture` and `side` are for GLB tiles alone.
struct ImageryOptions {
  std::shared_ptr<const dem::Imagery> image;  // null: none
  // The default of TileRequest::texture, for the server and bakes. TilePipeline::Build uses the request's.
  proto::TextureFormat texture = proto::TextureFormat::kJpeg;
  int side = 512;    // pixels along a tile's edge, at most: a power of two, 64 .. 1024
  int quality = 80;  // of JPEG and lossy WebP, 1 .. 100
  std::string attribution;
};

// A file that a dataset was opened from, and its stamp from before it was opened.
struct WatchedFile {
  std::string path;
  std::optional<dem::FileStamp> stamp;  // nullopt: there was no regular file
};

// Copies share the model, the water and the image, which do not change.
struct Dataset {
  std::string name;
  std::string attribution;
  double error_fraction = 0.5;  // that of the model's DemOptions: finite, > 0
  MeshOptions mesh_options;
  // `compression` is the default of TileRequest::compression, for the server and bakes, and of
  // DrawnSurface::compression. TilePipeline::Build uses the request's. TilePipeline sets the copyright, the texture,
  // `draco.uv` and both errors.
  proto::GlbOptions glb;
  std::shared_ptr<const dem::ElevationModel> model;  // null: there are no sources, only `baked`
  // An archive of tiles of this dataset, with the same generation if there are sources; null: none.
  std::shared_ptr<const BakedTiles> baked;
  std::vector<WatchedFile> baked_files;  // if one of them changes, the server opens the archive again
  WaterOptions water;
  ImageryOptions imagery;
  // N: quantized-mesh tiles of levels 0, N, 2N, ... have the metadata extension if it is requested. It lists the tiles
  // of the next N deeper levels. From level max_source_level() on, a tile without children has no metadata. 0: no tile
  // has it.
  int metadata_availability = 0;
  // Identifies the dataset and its contents, edits included: GenerationOf(dataset, model->fingerprint()). 0:
  // TilePipeline sets it to the dataset's position in datasets(), from 1. In another pipeline, the same position may
  // mean another dataset. So this dataset must not share a RefinementCache, TileTiers or TileStore with another
  // pipeline, neither at the same time nor later.
  std::uint64_t generation = 0;
  // GenerationOf(dataset, model->unedited_fingerprint()); 0: there are no edits.
  std::uint64_t unedited_generation = 0;
  // The generation in keys of caches. A dataset with edits has its unedited_generation there, and keys also have a hash
  // of the edits that the tile depends on (TileEditsHash). So a change of an edit leaves other tiles valid.
  std::uint64_t cache_generation() const { return unedited_generation != 0 ? unedited_generation : generation; }
  geo::ErrorScale error_scale() const;  // without a model, its `default_steps` is a view into `baked`
};

// A hash of `heights` (a fingerprint of the model), of the options of the dataset that change bytes, and of the
// versions of the encoders and their libraries.
std::uint64_t GenerationOf(const Dataset& dataset, std::uint64_t heights);

// A hash of the edits that the tile of a request depends on; 0: none.
std::uint64_t TileEditsHash(const dem::ElevationModel& model, const TileRequest& request);

}  // namespace terrace::tiler
