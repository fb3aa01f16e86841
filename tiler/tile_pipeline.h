// Makes what is served of datasets: tiles, heights and normals at points, lines of sight, meshes of areas.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "engine/core/result.h"
#include "engine/dem/elevation_model.h"
#include "tiler/area/area_mesh.h"
#include "tiler/dataset.h"
#include "tiler/store/cache_stats.h"
#include "tiler/surface/drawn_surface.h"
#include "tiler/surface/point_heights.h"
#include "tiler/tile/encoded_tile.h"
#include "tiler/tile/tile_request.h"

namespace terrace::tiler {

class DrawnMeshCache;
class RefinementCache;

// Thread-safe. Functions that read or build block. `dataset` is an index into datasets(). Functions that compute
// results are virtual, so that tests can replace them.
//
// Heights and refinements of tiles are kept between builds, up to `refinement_cache_bytes`; 0: none. A refinement is
// the record of the samples that greedy insertion added to a mesh, in their order. Build makes a quantized-mesh or GLB
// tile from a kept refinement, in any coding, if the tile's error is the same or larger. If it is smaller, Build
// inserts more samples. The bytes of a tile do not depend on what is kept. ReadDrawnPoints and LookAlong keep meshes
// besides, up to 32 MiB, and take up to 256 MiB more during a call.
class TilePipeline {
 public:
  explicit TilePipeline(std::vector<Dataset> datasets,
                        std::size_t refinement_cache_bytes = kDefaultRefinementCacheBytes);
  // With a cache that other pipelines may share, and that may outlive this one (tiler/store/refinement_cache.h, which
  // is not installed). Not null.
  TilePipeline(std::vector<Dataset> datasets, std::shared_ptr<RefinementCache> refinements);
  static constexpr std::size_t kDefaultRefinementCacheBytes = std::size_t{128} << 20;
  virtual ~TilePipeline();

  const std::vector<Dataset>& datasets() const { return datasets_; }

  // Makes one tile: reads, refines, quantizes, measures, encodes and compresses it. Without sources, takes it from the
  // archive. Errors:
  // - kNotFound: there is no such dataset; a key outside the tiling scheme of the format; a quantized-mesh or GLB tile
  //   that is not available; heights, a hillshade, slopes or contours deeper than DemInfo::max_mercator_depth; imagery
  //   without an image; without sources, a tile that the archive lacks.
  // - kInvalidArgument: `error_step`, `side_px` or a member of `map` that the format uses is out of its range; a
  //   texture or a tile of the image needs too many pixels of the image at once.
  // - kUnavailable: a source, the water mask, the image or the archive cannot be read now.
  // - kChanged: a file of a source, of the water mask or of the image was replaced, so the dataset has to be opened
  //   again.
  // - kInternal: an encoder failed.
  // - kCancelled: `stop` was requested.
  virtual Result<EncodedTile> Build(const TileRequest& request, std::stop_token stop) const;

  // As ElevationModel::ReadPoints, whose preconditions hold for the points of all functions below. kNotFound, here and
  // in ReadNormals, PlanArea and BuildArea: there is no such dataset, or it has no sources.
  virtual Result<PointHeights> ReadPoints(std::uint32_t dataset, std::span<const dem::GeoPosition> points,
                                          dem::HeightDatum datum, std::stop_token stop) const;

  // The normals of the surface of ReadPoints: unit vectors east, north, up. Slopes are those between the heights at
  // half the finest source's spacing on both sides of the point. NaN where the point has no height, where neither the
  // place to the west nor the one to the east has one, or where neither the place to the south nor the one to the north
  // has one. Errors: those of ReadPoints.
  virtual Result<std::vector<std::array<float, 3>>> ReadNormals(std::uint32_t dataset,
                                                                std::span<const dem::GeoPosition> points,
                                                                std::stop_token stop) const;

  // Heights, and with `normals` also normals, of the meshes that clients decode. NaN in holes that edits cut. Where the
  // level has no tile, the mesh of the deepest available tile of a shallower level is read. Errors:
  // - kInvalidArgument: the dataset has no such level; the points lie in more than 64 tiles, or in tiles whose meshes
  //   take more than 256 MiB.
  // - kNotFound: there is no such dataset; without sources: a surface of kGlb, or an archive without quantized-mesh
  //   tiles.
  // - Others: those of Build.
  virtual Result<PointHeights> ReadDrawnPoints(std::uint32_t dataset, const DrawnSurface& surface,
                                               std::span<const dem::GeoPosition> points, bool normals,
                                               std::stop_token stop) const;

  // Lines of sight over the sources' surface (no `surface`: ElevationModel::LookAlong) or over a drawn one; one answer
  // for each ray. Preconditions: those of ElevationModel::LookAlong. Errors: those of ElevationModel::LookAlong,
  // ReadPoints and ReadDrawnPoints; kInvalidArgument: all rays together are longer than 2 x 10^8 steps. A step is the
  // finest source's spacing; without sources a 256th of the north-south side of a tile of the surface's level, at most
  // 500 m.
  virtual Result<std::vector<dem::SightAnswer>> LookAlong(std::uint32_t dataset,
                                                          const std::optional<DrawnSurface>& surface,
                                                          std::span<const dem::SightRay> rays,
                                                          const dem::SightOptions& options, std::stop_token stop) const;

  // As PlanArea and BuildAreaMesh of area_mesh.h. PlanArea reads nothing and returns at once.
  virtual Result<AreaPlan> PlanArea(std::uint32_t dataset, const AreaRequest& area, std::size_t max_samples) const;
  virtual Result<EncodedTile> BuildArea(std::uint32_t dataset, const AreaPlan& plan, const AreaRequest& area,
                                        std::stop_token stop) const;

  CacheStats drawn_meshes() const;  // its hits and misses are not counted and stay 0
  CacheStats refinements() const;

 private:
  // kNotFound: there is no such dataset; for FindModel also: it has no sources.
  Result<const Dataset*> Find(std::uint32_t dataset) const;
  Result<const dem::ElevationModel*> FindModel(std::uint32_t dataset) const;

  const std::vector<Dataset> datasets_;
  const std::unique_ptr<DrawnMeshCache> drawn_;
  const std::shared_ptr<RefinementCache> refinements_;
};

}  // namespace terrace::tiler
