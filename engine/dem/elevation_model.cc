#include "engine/dem/elevation_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "engine/common/content_hash.h"
#include "engine/common/parallel_for.h"
#include "engine/core/check.h"
#include "engine/crs/footprint.h"
#include "engine/crs/level_plan.h"
#include "engine/dem/dem_impl.h"
#include "engine/gdal/stamped_files.h"
#include "engine/geo/octave.h"
#include "engine/geo/tile_cover.h"
#include "engine/mosaic/availability.h"
#include "engine/mosaic/point_blocks.h"
#include "engine/sources/open_rasters.h"
#include "engine/sources/raster_source.h"
#include "engine/statistics/cache_folder.h"

namespace terrace::dem {
namespace {

Result<void> CheckOptions(const DemOptions& options) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0; };
  if (!positive(options.error_fraction)) {
    return MakeError(ErrorCode::kInvalidArgument, "error fraction {}: must be a number above 0",
                     options.error_fraction);
  }
  if (options.finest_error && !positive(*options.finest_error)) {
    return MakeError(ErrorCode::kInvalidArgument, "finest error {} m: must be a number above 0", *options.finest_error);
  }
  if (options.floor && !(std::abs(*options.floor) <= kMaxAbsHeight)) {
    return MakeError(ErrorCode::kInvalidArgument, "floor {} m: must be a height on Earth", *options.floor);
  }
  constexpr double kWidestFeather = 1e6;
  if (!(options.feather >= 0 && options.feather <= kWidestFeather)) {
    return MakeError(ErrorCode::kInvalidArgument, "feather {} m: must be 0 (none) to {:.0f} m", options.feather,
                     kWidestFeather);
  }
  constexpr int kMaxGap = 4096;
  if (options.max_void_gap < 0 || options.max_void_gap > kMaxGap) {
    return MakeError(ErrorCode::kInvalidArgument, "void gap {}: must be 0 (fill nothing) to {} samples",
                     options.max_void_gap, kMaxGap);
  }
  return {};
}

// Adds all that the heights of a raster depend on.
Result<void> AddRaster(ContentHasher& hasher, const RasterSource& raster, const FileContentOptions& options) {
  hasher.Add(raster.content());
  if (auto placed = raster.georeference().AddTo(hasher, options); !placed) return placed;
  const SampleRules& rules = raster.layout().rules;
  hasher.Add(rules.nodata.has_value());
  hasher.Add(rules.nodata.value_or(0));
  for (const double number : {rules.scale, rules.offset, rules.metres_per_unit, rules.lowest, rules.highest}) {
    hasher.Add(number);
  }
  // Detected and configured voids.
  hasher.Add(rules.void_margin);
  hasher.Add(std::uint64_t{rules.extra_nodata.size()});
  for (const double value : rules.extra_nodata) hasher.Add(value);
  return {};
}

Result<void> AddVertical(ContentHasher& hasher, const RasterGrid& grid, const FileContentOptions& content) {
  const auto& geoid = grid.vertical().geoid;
  hasher.Add(grid.vertical().is_known());
  hasher.Add(geoid != nullptr);
  return geoid ? geoid->AddTo(hasher, content) : Result<void>();
}

FileContentOptions ContentOptionsOf(const DemOptions& options) {
  return {options.cache.folder ? options.cache.folder->path() : std::string(), options.stop};
}

Result<std::uint64_t> FingerprintOf(const std::vector<RasterGrid>& grids, const DemOptions& options, double floor) {
  const FileContentOptions content = ContentOptionsOf(options);
  ContentHasher hasher;
  for (const RasterGrid& grid : grids) {
    hasher.Add(std::uint64_t{grid.members().size()});  // includes which rasters form a raster grid
    for (const GridMember& member : grid.members()) {
      if (auto added = AddRaster(hasher, *member.raster, content); !added) return tl::unexpected(added.error());
    }
    if (auto added = AddVertical(hasher, grid, content); !added) return tl::unexpected(added.error());
  }
  for (const double number : {options.error_fraction, options.finest_error.value_or(0), floor, options.feather}) {
    hasher.Add(number);
  }
  hasher.Add(options.max_void_gap);
  hasher.Add(static_cast<std::uint8_t>(options.holes));
  return hasher.Hash().low;
}

// The parts of the fingerprint, for tiles that do not depend on all rasters.
Result<std::vector<GridContent>> ContentsOf(const std::vector<RasterGrid>& grids, const DemOptions& options) {
  const FileContentOptions content = ContentOptionsOf(options);
  std::vector<GridContent> contents;
  for (const RasterGrid& grid : grids) {
    GridContent& of_grid = contents.emplace_back();
    for (const GridMember& member : grid.members()) {
      ContentHasher hasher;
      if (auto added = AddRaster(hasher, *member.raster, content); !added) return tl::unexpected(added.error());
      of_grid.members.push_back(hasher.Hash());
    }
    ContentHasher hasher;
    if (auto added = grid.georeference().AddTo(hasher, content); !added) return tl::unexpected(added.error());
    grid.AddTo(hasher);
    if (auto added = AddVertical(hasher, grid, content); !added) return tl::unexpected(added.error());
    of_grid.grid = hasher.Hash();
  }
  return contents;
}

// A sixteenth of an octave: tiles of one product differ by less, as meridians converge.
int ResolutionStep(const RasterSource& raster) {
  double power = raster.spacing().finer;
  for (int i = 0; i < 4; ++i) power *= power;  // the sixteenth: squared four times
  return geo::NearestOctave(power);
}

// Orders raster grids by rank, then by resolution, finer first, then by path.
Result<std::vector<RasterGrid>> GridsOf(const std::vector<DemFile>& files, const Rasters& rasters,
                                        const GridOptions& options) {
  std::map<int, Rasters> ranks;
  for (std::size_t i = 0; i < files.size(); ++i) ranks[files[i].rank].push_back(rasters[i]);
  std::vector<GridPlan> plans;
  for (auto& [rank, those] : ranks) {
    std::ranges::sort(those, {},
                      [](const auto& raster) { return std::pair(ResolutionStep(*raster), raster->info().path); });
    std::ranges::move(PlanGrids(those), std::back_inserter(plans));
  }
  std::vector<std::optional<Result<RasterGrid>>> made(plans.size());
  ParallelFor(plans.size(), [&](std::size_t i) {
    made[i] = RasterGrid::Make(std::move(plans[i]), options);
    return made[i]->has_value();
  });
  std::vector<RasterGrid> grids;
  for (auto& grid : made) {
    if (!*grid) return tl::unexpected(grid->error());  // after the first failure, rasters may be missing
    grids.push_back(**std::move(grid));
  }
  return grids;
}

// Leaves out rasters without heights, except parts of holes: without them, these would be collars. Moves their names
// with the reason to `left_out`.
Result<std::vector<RasterGrid>> GridsOfHeights(std::vector<DemFile>& files, Rasters& rasters,
                                               const GridOptions& options, std::vector<std::string>& left_out) {
  auto grids = GridsOf(files, rasters, options);
  if (!grids) return grids;
  std::set<const RasterSource*> useless;
  for (const RasterGrid& grid : *grids) {
    for (std::size_t i = 0; i < grid.members().size(); ++i) {
      const RasterSource& raster = *grid.members()[i].raster;
      if (!raster.has_heights() && !grid.HasPartOfHole(i)) useless.insert(&raster);
    }
  }
  if (useless.empty()) return grids;
  std::vector<DemFile> kept;
  std::vector<std::string> texts;
  for (std::size_t i = 0; i < files.size(); ++i) {
    if (useless.contains(rasters[i].get())) {
      texts.push_back(rasters[i]->DescribeLackOfHeights());
    } else {
      kept.push_back(std::move(files[i]));
    }
  }
  std::erase_if(rasters, [&](const auto& raster) { return useless.contains(raster.get()); });
  files = std::move(kept);
  LogLeftOut(texts);
  std::ranges::move(texts, std::back_inserter(left_out));
  return GridsOf(files, rasters, options);
}

// The smallest box that contains all footprints.
GeoBounds BoundsOf(const Rasters& rasters) {
  if (rasters.size() == 1) return rasters.front()->info().bounds;
  std::vector<Footprint> boxes;
  for (const auto& raster : rasters) boxes.push_back(raster->footprint());
  std::ranges::sort(boxes, {}, &Footprint::west);
  Footprint hull = boxes.front();
  // Parts beyond the antimeridian come first in the order of longitudes.
  const double beyond = std::ranges::max_element(boxes, {}, &Footprint::east)->east - 360;
  double covered = std::max(hull.east, beyond), gap = 0, gap_end = hull.west;  // the widest gap ends at gap_end
  for (const Footprint& box : boxes) {
    hull.south = std::min(hull.south, box.south);
    hull.north = std::max(hull.north, box.north);
    if (box.west - covered > gap) {
      gap = box.west - covered;
      gap_end = box.west;
    }
    covered = std::max(covered, box.east);
  }
  const double last_gap = boxes.front().west + 360 - covered;
  constexpr double kNoGap = 1e-9;  // pieces of one grid meet up to the rounding of their corners
  if (std::max(gap, last_gap) <= kNoGap) return {-180, hull.south, 180, hull.north};
  const double west = last_gap >= gap ? boxes.front().west : gap_end;
  const double east = west + 360 - std::max(gap, last_gap);
  return {west, hull.south, east > 180 ? east - 360 : east, hull.north};
}

DemInfo InfoOf(const std::vector<RasterGrid>& grids, const Rasters& rasters, const DemOptions& options) {
  DemInfo info;
  std::vector<HeightRange> ranges(grids.size());
  ParallelFor(grids.size(), [&](std::size_t i) {
    ranges[i] = grids[i].EllipsoidalRange();
    return true;
  });
  info.heights = ranges.front();
  info.bounds = BoundsOf(rasters);
  for (const RasterGrid& grid : grids) {
    const HeightRange& ellipsoidal = ranges[static_cast<std::size_t>(&grid - grids.data())];
    info.heights.min = std::min(info.heights.min, ellipsoidal.min);
    info.heights.max = std::max(info.heights.max, ellipsoidal.max);
    for (const GridMember& member : grid.members()) {
      info.sources.push_back(member.raster->info());
      info.sources.back().ellipsoidal = ellipsoidal;
    }
    info.max_mercator_depth = std::max(info.max_mercator_depth, DeepestMercator(grid.spacing()));
  }
  info.floor = RoundHeight(options.floor.value_or(info.heights.min));
  return info;
}

std::vector<SourceExtent> SourceExtentsOf(const std::vector<RasterGrid>& grids, const DemOptions& options) {
  const double finest =
      std::ranges::min_element(grids, {}, [](const RasterGrid& s) { return s.spacing().finer; })->spacing().finer;
  std::vector<SourceExtent> extents;
  for (const RasterGrid& grid : grids) {
    // `finest_error` applies to the finest source; for the other sources it is scaled by their spacing.
    const auto goal =
        options.finest_error ? std::optional(*options.finest_error * (grid.spacing().finer / finest)) : std::nullopt;
    const int depth = DeepestLevel(grid.spacing(), options.error_fraction, goal);
    for (const GridMember& member : grid.members()) extents.push_back({member.raster->footprint(), depth});
  }
  return extents;
}

}  // namespace

ElevationModel::ElevationModel(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
ElevationModel::~ElevationModel() = default;

Result<std::unique_ptr<ElevationModel>> ElevationModel::Open(const std::string& path, const DemOptions& options) {
  return Open(std::vector<DemFile>{{path}}, options);
}

Result<std::unique_ptr<ElevationModel>> ElevationModel::Open(std::vector<DemFile> files, const DemOptions& options) {
  return OpenAs(std::move(files), options, /*only_cached=*/false);
}

Result<std::unique_ptr<ElevationModel>> ElevationModel::OpenFromCache(std::vector<DemFile> files,
                                                                      const DemOptions& options) {
  return OpenAs(std::move(files), options, /*only_cached=*/true);
}

Result<std::unique_ptr<ElevationModel>> ElevationModel::OpenAs(std::vector<DemFile> files, const DemOptions& options,
                                                               bool only_cached) try {
  if (files.empty()) return MakeError(ErrorCode::kInvalidArgument, "an elevation model needs a source");
  if (auto checked = CheckOptions(options); !checked)
    return MakeError(checked.error().code, "{}: {}", files.front().path, checked.error().message);
  std::vector<std::string> left_out;
  auto rasters = OpenRasters(files, options, left_out, only_cached);
  if (!rasters) return tl::unexpected(rasters.error());
  auto grids = GridsOfHeights(files, *rasters, {options.max_void_gap, options.holes, options.feather}, left_out);
  if (!grids) return tl::unexpected(grids.error());

  auto impl = std::make_unique<Impl>();
  impl->grids = *std::move(grids);
  impl->has_feather = options.feather > 0;
  impl->index = IndexOf(impl->grids);
  const auto finest = std::ranges::min_element(impl->grids, {}, [](const RasterGrid& s) { return s.spacing().finer; });
  impl->info = InfoOf(impl->grids, *rasters, options);
  impl->info.left_out = std::move(left_out);
  impl->available = AvailableTiles(SourceExtentsOf(impl->grids, options));
  impl->info.max_level = static_cast<int>(impl->available.size()) - 1;
  impl->info.max_source_level = impl->info.max_level;
  impl->lattices = PlanLattices(finest->spacing(), impl->info.max_level);
  impl->floor = static_cast<float>(impl->info.floor);
  for (const RasterGrid& grid : impl->grids) {
    if (const auto& geoid = grid.vertical().geoid) {
      auto undulations = Undulations::OfEarth(geoid);
      if (!undulations) return tl::unexpected(undulations.error());
      impl->floor_undulations = *std::move(undulations);
    }
  }
  const auto fingerprint = FingerprintOf(impl->grids, options, impl->floor);
  if (!fingerprint) return tl::unexpected(fingerprint.error());
  impl->fingerprint = *fingerprint;
  auto contents = ContentsOf(impl->grids, options);
  if (!contents) return tl::unexpected(contents.error());
  impl->contents = *std::move(contents);
  if (auto opened = impl->OpenEdits(options); !opened) return tl::unexpected(std::move(opened).error());
  return std::unique_ptr<ElevationModel>(new ElevationModel(std::move(impl)));
} catch (const ThrownError& thrown) {  // of statistics that are read again
  return tl::unexpected(thrown.error());
}

const DemInfo& ElevationModel::info() const { return impl_->info; }
int ElevationModel::max_level() const { return impl_->info.max_level; }
int ElevationModel::max_source_level() const { return impl_->info.max_source_level; }
geo::Lattice ElevationModel::LatticeOf(int level) const { return impl_->LatticeOf(level); }
std::uint64_t ElevationModel::fingerprint() const { return impl_->fingerprint; }

bool ElevationModel::has_lost_cache() const {
  return std::ranges::any_of(impl_->grids, [](const RasterGrid& grid) {
    return std::ranges::any_of(grid.members(),
                               [](const GridMember& member) { return member.raster->has_lost_cache(); });
  });
}

StampedFiles ElevationModel::files() const {
  StampedFiles all;
  std::set<const Geoid*> geoids;
  for (const RasterGrid& grid : impl_->grids) {
    for (const GridMember& member : grid.members()) all.Append(member.raster->files());
    // Most raster grids share one geoid.
    const auto& geoid = grid.vertical().geoid;
    if (geoid && geoids.insert(geoid.get()).second) all.Append(geoid->files());
  }
  all.Append(impl_->edit_files);
  return all;
}

const std::vector<geo::TileRange>& ElevationModel::Available(int level) const {
  static const std::vector<geo::TileRange> none;
  if (level < 0 || level > max_level()) return none;
  return impl_->available[static_cast<std::size_t>(level)];
}

const std::vector<std::vector<geo::TileRange>>& ElevationModel::Availability() const { return impl_->available; }

bool ElevationModel::IsAvailable(const geo::TileKey& key) const { return geo::IsAvailable(impl_->available, key); }

Result<TileHeights> ElevationModel::Read(const geo::TileKey& key, std::stop_token stop) const {
  TERRACE_CHECK(geo::IsValid(key));
  return impl_->Read(key, HeightDatum::kEllipsoid, stop);
}

Result<TileHeights> ElevationModel::ReadInSourceDatum(const geo::TileKey& key, std::stop_token stop) const {
  TERRACE_CHECK(geo::IsValid(key));
  return impl_->Read(key, HeightDatum::kSource, stop);
}

SampleCounts ElevationModel::CountSamples() const {
  SampleCounts sum;
  for (const RasterGrid& grid : impl_->grids) {
    const SampleCounts counts = grid.CountSamples();
    sum.measured += counts.measured;
    sum.filled += counts.filled;
    sum.voids += counts.voids;
  }
  return sum;
}

KeptBlocks ElevationModel::CountKeptBlocks() {
  const PointBlockCache& cache = PointBlockCache::Shared();
  return {cache.count(), cache.bytes()};
}

bool ElevationModel::has_datum() const {
  return std::ranges::none_of(impl_->info.sources,
                              [](const RasterInfo& raster) { return raster.datum_in_use.empty(); });
}

bool ElevationModel::has_geoid() const { return impl_->floor_undulations != nullptr; }

}  // namespace terrace::dem
