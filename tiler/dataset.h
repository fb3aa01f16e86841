// A dataset: its sources or its archive, and the options of its tiles.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/image/imagery.h"
#include "engine/image/water_raster.h"
#include "proto/gltf/glb_options.h"
#include "tiler/mesh/mesh_options.h"
#include "tiler/tile/requested_error.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

class BakedTiles;  // an archive of baked tiles: tiler/store/baked_tiles.h, which is not installed

// The source of a dataset's water: a mask, a sea level, or none. At most one is set.
struct WaterOptions {
  std::shared_ptr<const dem::WaterRaster> mask;
  std::optional<double> sea_level_m;  // in the vertical datum of each source

  bool any() const { return mask != nullptr || sea_level_m.has_value(); }
};

// The image shown by textures of GLB tiles and by image tiles for maps. `texture` and `side` are for GLB tiles alone.
struct ImageryOptions {
  std::shared_ptr<const dem::Imagery> image;  // null: none
  // The default for TileRequest::texture: bakes use it, and the server if a client names no texture. TilePipeline reads
  // only TileRequest::texture.
  proto::TextureFormat texture = proto::TextureFormat::kJpeg;
  int side = 512;    // pixels along a tile's edge, at most: a power of two from 64 to 1024
  int quality = 80;  // of JPEG and lossy WebP: 1 .. 100
  std::string attribution;
};

// A file that a dataset was opened from, and its stamp from before it was opened.
struct WatchedFile {
  std::string path;
  std::optional<dem::FileStamp> stamp;  // nullopt: there was no regular file
};

// One served dataset. Copies share the model, water and imagery, which are immutable: a reload keeps a dataset that
// has not changed.
struct Dataset {
  std::string name;
  std::string attribution;
  double error_fraction = 0.5;  // that of the model's DemOptions: finite, > 0
  MeshOptions mesh_options;
  // Of GLB tiles. `compression` is the default for TileRequest::compression, which bakes and the server use, and for
  // DrawnSurface::compression. TilePipeline sets the copyright, the texture, `draco.uv` and both errors itself.
  proto::GlbOptions glb;
  std::shared_ptr<const dem::ElevationModel> model;  // null: there are no sources, and `baked` is not null
  // An archive of tiles of this dataset, with the same generation if there are sources; null: none.
  std::shared_ptr<const BakedTiles> baked;
  std::vector<WatchedFile> baked_files;  // a change of one of them means that there is another archive
  WaterOptions water;
  ImageryOptions imagery;
  // N: on request, the quantized-mesh tiles of levels 0, N, 2N, ... have the metadata extension, which lists the tiles
  // of the N levels below. On level max_source_level() and deeper ones, a tile without children has no metadata. 0: no
  // tile has it.
  int metadata_availability = 0;
  // Identifies the dataset and its contents, edits included. If a cache outlives the pipeline or serves several, set it
  // to GenerationOf(dataset, model->fingerprint()). If it is left at 0, TilePipeline sets it to the dataset's position,
  // counted from 1, in its datasets(). Other pipelines use the same numbers, so such a dataset must not share a
  // RefinementCache, TileTiers or TileStore with another pipeline, neither at the same time nor later.
  std::uint64_t generation = 0;
  // GenerationOf(dataset, model->unedited_fingerprint()); 0: there are no edits. Keys of cached tiles and refinements
  // contain cache_generation() and a hash of the edits that the tile depends on, so that other tiles stay valid when an
  // edit changes. This hash is TileEditsHash for tiles and dem::TileEdits::Hash for refinements.
  std::uint64_t unedited_generation = 0;
  std::uint64_t cache_generation() const { return unedited_generation != 0 ? unedited_generation : generation; }
  ErrorScale error_scale() const;  // without a model, its `default_steps` is a view into `baked`
  std::uint64_t options_hash = 0;  // GenerationOf(dataset, /*heights=*/0); only bakes need it
};

// A hash of three things: `heights` (a fingerprint of the model), all options of the dataset that change bytes, and the
// encoders with their libraries. Equal for copies of the files.
std::uint64_t GenerationOf(const Dataset& dataset, std::uint64_t heights);

// A hash of the edits that the tile of a request depends on; 0: none.
std::uint64_t TileEditsHash(const dem::ElevationModel& model, const TileRequest& request);

}  // namespace terrace::tiler
