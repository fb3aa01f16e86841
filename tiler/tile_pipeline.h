// From a request to bytes, as one plain blocking function: used as it is by the server, tests and benchmarks.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/dem_source.h"
#include "engine/dem/image/imagery.h"
#include "engine/dem/image/water_raster.h"
#include "proto/gltf/glb_tile.h"
#include "proto/gltf/texture.h"
#include "tiler/encoded_tile.h"
#include "tiler/mesh/tile_mesher.h"
#include "tiler/store/refinement_cache.h"
#include "tiler/tile_request.h"

namespace terrace::tiler {

// Where a dataset's water comes from: one of both, or neither, and it has none.
struct WaterRules {
  std::shared_ptr<const dem::WaterRaster> mask;
  std::optional<double> sea_level_m;  // in what the source's heights count from

  bool any() const { return mask != nullptr || sea_level_m.has_value(); }
};

// What textures of GLB tiles are cut from.
struct ImageryRules {
  std::shared_ptr<const dem::Imagery> image;                   // null: none
  proto::TextureFormat texture = proto::TextureFormat::kJpeg;  // what requests get that name none
  int side = 512;                                              // pixels along a tile's edge, at most
  int quality = 80;                                            // of EncodePicture
  std::string attribution;
};

// One served dataset: a name, a source and what its users should read. Copies share what they read from, which is
// immutable: a dataset that has not changed goes on in the next catalog.
struct Dataset {
  std::string name;
  std::string attribution;
  double error_fraction = 0.5;
  MeshRules rules;
  proto::GlbOptions glb;  // compression: what GLB requests get that name none
  std::shared_ptr<const dem::DemSource> source;
  WaterRules water;
  ImageryRules imagery;
  int metadata_levels = 0;       // tiles of every so many levels tell what is below them; 0: none
  std::uint64_t generation = 0;  // hash of the source's fingerprint and every option that changes bytes
};

// Thread-safe: Build may run on any number of threads at once.
//
// What a tile is made from is kept between builds, as much as `refinement_cache_bytes` allows: another error, format or
// coding of it costs a replay and an encoding. The bytes do not depend on it.
class TilePipeline {
 public:
  explicit TilePipeline(std::vector<Dataset> datasets,
                        std::size_t refinement_cache_bytes = kDefaultRefinementCacheBytes);
  // The same with a cache that others share: one that outlives the catalog.
  TilePipeline(std::vector<Dataset> datasets, std::shared_ptr<RefinementCache> refinements);
  static constexpr std::size_t kDefaultRefinementCacheBytes = std::size_t{128} << 20;

  const std::vector<Dataset>& datasets() const { return datasets_; }

  // Reads, refines, quantizes, measures, encodes and compresses one tile. All formats share the refinement.
  // kNotFound: no such dataset or tile outside availability. kUnavailable: the source cannot be read now.
  // kCancelled: `stop` was requested.
  Result<EncodedTile> Build(const TileRequest& request, std::stop_token stop) const;

  ByteCacheStats refinements() const { return refinements_->stats(); }

 private:
  Result<RefinedTilePtr> Refine(const Dataset& dataset, const geo::TileKey& key, double error_m, EncodedTile& encoded,
                                const std::stop_token& stop) const;

  Result<void> EncodeQuantizedMesh(const TileRequest& request, const RefinedTile& refined, double error_m,
                                   EncodedTile& encoded, const std::stop_token& stop) const;
  Result<void> EncodeGlb(const TileRequest& request, const RefinedTile& refined, double error_m, EncodedTile& encoded,
                         const std::stop_token& stop) const;

  const std::vector<Dataset> datasets_;
  const std::shared_ptr<RefinementCache> refinements_;
};

}  // namespace terrace::tiler
