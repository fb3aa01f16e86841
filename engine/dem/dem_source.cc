#include "engine/dem/dem_source.h"

#include <xxhash.h>

#include <algorithm>
#include <cmath>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "engine/dem/dem_impl.h"
#include "engine/dem/footprint.h"
#include "engine/dem/level_plan.h"
#include "engine/dem/raster_source.h"

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
  constexpr int kMaxGap = 4096;
  if (options.max_void_gap < 0 || options.max_void_gap > kMaxGap) {
    return MakeError(ErrorCode::kInvalidArgument, "void gap {}: must be 0 (fill nothing) to {} samples",
                     options.max_void_gap, kMaxGap);
  }
  return {};
}

std::uint64_t FingerprintOf(const StampedFiles& files, const DemOptions& options, double floor) {
  // Changes whenever the same file and options would give other heights than before.
  constexpr std::uint32_t kResamplingVersion = 1;
  ByteWriter writer;
  writer.Put(kResamplingVersion);
  for (const FileStamp& stamp : files.stamps()) {
    for (const std::uint64_t part : {stamp.device, stamp.inode, stamp.size, stamp.modified_ns}) writer.Put(part);
  }
  writer.Put(options.error_fraction);
  writer.Put(options.finest_error.value_or(0));
  writer.Put(floor);
  writer.Put(options.max_void_gap);
  const std::string bytes = writer.Take();
  return XXH3_64bits(bytes.data(), bytes.size());
}

}  // namespace

DemSource::DemSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DemSource::~DemSource() = default;

Result<std::unique_ptr<DemSource>> DemSource::Open(const std::string& path, const DemOptions& options) {
  if (auto checked = CheckOptions(options); !checked)
    return MakeError(checked.error().code, "{}: {}", path, checked.error().message);
  auto opened = RasterSource::Open(path, options.cache_dir, options.progress);
  if (!opened) return tl::unexpected(opened.error());
  const std::shared_ptr<const RasterSource> raster = *std::move(opened);

  auto impl = std::make_unique<Impl>();
  impl->sheets.emplace_back(raster, options.max_void_gap);
  impl->lattices = PlanLattices(raster->spacing());
  impl->info.sources = {raster->info()};
  impl->info.bounds = raster->info().bounds;
  impl->info.heights = raster->info().heights;
  impl->info.max_mercator_depth = DeepestMercator(raster->spacing());
  impl->info.max_level = DeepestLevel(raster->spacing(), options.error_fraction, options.finest_error);
  impl->available = TilesTouching(raster->footprint(), impl->info.max_level);
  impl->floor = RoundHeight(options.floor.value_or(impl->info.heights.min));
  impl->info.floor = impl->floor;
  impl->fingerprint = FingerprintOf(raster->files(), options, impl->floor);
  return std::unique_ptr<DemSource>(new DemSource(std::move(impl)));
}

const DemInfo& DemSource::info() const { return impl_->info; }
int DemSource::max_level() const { return impl_->info.max_level; }
geo::Lattice DemSource::LatticeOf(int level) const { return impl_->LatticeOf(level); }
std::uint64_t DemSource::fingerprint() const { return impl_->fingerprint; }

const std::vector<geo::TileRange>& DemSource::Available(int level) const {
  static const std::vector<geo::TileRange> none;
  if (level < 0 || level > max_level()) return none;
  return impl_->available[static_cast<std::size_t>(level)];
}

bool DemSource::IsAvailable(const geo::TileKey& key) const {
  return geo::IsValid(key) &&
         std::ranges::any_of(Available(key.level), [&](const geo::TileRange& range) { return range.Contains(key); });
}

HeightRange DemSource::RangeBound(const geo::TileKey& key) const {
  TERRACE_CHECK(geo::IsValid(key));
  return impl_->RangeBound(key);
}

Result<TileHeights> DemSource::Read(const geo::TileKey& key, std::stop_token stop) const {
  TERRACE_CHECK(geo::IsValid(key));
  return impl_->Read(key, stop);
}

Result<std::vector<float>> DemSource::ReadNodes(int level, const NodeWindow& window, std::stop_token stop) const {
  TERRACE_CHECK(level >= 0 && level <= geo::kMaxLevel && window.columns > 0 && window.rows > 0);
  TERRACE_CHECK(window.row >= 0 && window.row + window.rows - 1 <= LatticeOf(level).rows());
  return impl_->ReadNodes(level, window, fmt::format("an area of level {}", level), stop);
}

Result<std::vector<float>> DemSource::ReadMercator(int depth, const NodeWindow& window, std::stop_token stop) const {
  TERRACE_CHECK(depth >= 0 && depth <= geo::kMaxLevel && window.columns > 0 && window.rows > 0);
  TERRACE_CHECK(window.row >= 0 && window.row + window.rows <= geo::MercatorGrid{depth}.rows());
  return impl_->ReadMercator(depth, window, stop);
}

Result<std::vector<float>> DemSource::ReadPoints(std::span<const GeoPosition> points, std::stop_token stop) const {
  return impl_->ReadPoints(points, stop);
}

}  // namespace terrace::dem
