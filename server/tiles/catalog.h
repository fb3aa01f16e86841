// Everything that is served at one moment: the datasets, and the pipeline that makes their tiles, heights and meshes.
//
// Immutable, so any thread reads it without a lock. An answer uses the catalog it began with until its end, and so does
// a build that it starts: answers never mix two catalogs.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "engine/dem/elevation_model.h"
#include "engine/geo/error_ladder.h"
#include "engine/geo/tile_key.h"
#include "engine/image/imagery.h"
#include "proto/gltf/glb_tile.h"
#include "tiler/encoder_version.h"
#include "tiler/store/baked_tiles.h"
#include "tiler/tile_pipeline.h"

namespace terrace::server {

// A dataset as requests and documents see it: its name, its extent and the tiles that exist. Its index in the catalog's
// list is TileRequest::dataset.
struct DatasetView : tiler::DatasetExtent {
  std::string name;
  std::string attribution;
  geo::ErrorScale error_scale = {};
  proto::GlbCompression glb_compression = proto::GlbCompression::kDraco;  // for requests that name none
  std::uint64_t generation = 0;        // changes whenever the bytes of its tiles may change
  std::uint64_t cache_generation = 0;  // the dataset's part of cache keys: Dataset::cache_generation
  // tiler::TileEditsHash. Empty: there are no edits.
  std::function<std::uint64_t(const tiler::TileRequest&)> edits_hash = {};
  // A range that contains all samples of a tile: ElevationModel::RangeBound, whose ThrownError is returned, or
  // BakedTiles::RangeBound, with its errors. Thread-safe. Empty: `heights` holds for all tiles.
  std::function<Result<dem::HeightRange>(const geo::TileKey&)> range_bound = {};
  std::optional<dem::ImageExtent> imagery = {};  // of the image, for map tiles; nothing: none
  std::string imagery_attribution = {};
  int min_mercator_depth = 0, max_mercator_depth = 1;  // of the geo::MercatorGrids of height tiles
  // Of height tiles; nothing: `bounds`.
  std::optional<dem::GeoBounds> height_tile_bounds;
  std::optional<tiler::Coding> baked_coding;  // of the tiles of its archive; nothing: it has no archive
  // The archive of a dataset that has no sources; null: it has sources. Parameters that a request omits are then those
  // of the archive.
  std::shared_ptr<const tiler::BakedTiles> only_archive = nullptr;

  // The version in URLs; changes with the generation.
  std::string version() const { return tiler::VersionText(generation); }
  int max_level() const { return static_cast<int>(available.size()) - 1; }
};

struct Catalog {
  std::vector<DatasetView> datasets;
  std::shared_ptr<const tiler::TilePipeline> pipeline;
  std::vector<std::string> pending = {};  // names of datasets that are configured and not open yet
};
using CatalogPtr = std::shared_ptr<const Catalog>;

// The problem of a dataset whose reopening takes long. /readyz shows this text and the next one. For other problems,
// which name files, it says only that the log has the reason.
inline constexpr const char* kReopening = "is being reopened; cached tiles are still served";

// The problem of a dataset without sources whose archive is outdated (BakedTiles::is_outdated).
inline constexpr const char* kArchiveFault = "files of its archive are missing or cannot be read";

CatalogPtr MakeCatalog(std::shared_ptr<const tiler::TilePipeline> pipeline, std::vector<std::string> pending = {});

// Also false for keys outside the tiling scheme.
bool IsAvailable(const DatasetView& dataset, const geo::TileKey& key);

// On the deepest level of the sources (levels that edits added do not count) or of the archive, returns the bounds of
// the largest range and of the ranges connected with it, clipped to the dataset's bounds. Degrees; west > east: across
// the antimeridian.
dem::GeoBounds FinestBounds(const DatasetView& dataset);

// Whether two boxes share a point, even if only on an edge. `tile` does not cross the antimeridian.
bool Intersects(const dem::GeoBounds& box, const dem::GeoBounds& tile);

// Whether a Web Mercator tile of `size` pixels exists: its level is 0 .. MaxHeightTileLevel, and it intersects the
// dataset's bounds. Also false for keys outside the scheme.
bool IsHeightTileAvailable(const DatasetView& dataset, const geo::TileKey& key, int size);
int MaxHeightTileLevel(const DatasetView& dataset, int size);
// The first level of height tiles in an archive; 0 if the dataset has sources.
int MinHeightTileLevel(const DatasetView& dataset, int size);

}  // namespace terrace::server
