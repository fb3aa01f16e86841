#include "engine/dem/dem_source.h"

#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <algorithm>
#include <cmath>

#include "engine/core/bytes.h"
#include "engine/core/check.h"
#include "engine/dem/dem_impl.h"
#include "engine/dem/gdal_runtime.h"
#include "engine/dem/raster_file.h"
#include "engine/dem/raster_scan.h"

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

RasterLayout LayoutOf(GDALDataset& dataset, const Georeference& georeference) {
  RasterLayout layout;
  layout.width = georeference.width();
  layout.height = georeference.height();
  layout.wraps = georeference.wrap_columns() > 0;
  layout.columns = layout.wraps ? georeference.wrap_columns() : layout.width;
  layout.rules = SampleRules::Of(HeightBand(dataset), georeference.vertical_unit());
  layout.overview_factors = OverviewFactors(HeightBand(dataset));
  return layout;
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

// Heights at the poles of a geographic source whose first or last row holds them.
std::array<std::optional<float>, 2> PoleHeights(const Georeference& georeference, const RasterScan& scan) {
  std::array<std::optional<float>, 2> heights;
  if (!georeference.is_geographic_grid()) return heights;
  for (const int pole : {0, 1}) {
    Position position{0, pole == 0 ? -90.0 : 90.0};
    georeference.ToPixels({&position, 1});
    constexpr double kEdgeTolerance = 1e-6;
    if (!(position.y >= -kEdgeTolerance && position.y <= georeference.height() + kEdgeTolerance)) continue;
    const auto& mean = scan.edge_row_means[position.y < georeference.height() / 2.0 ? 0 : 1];
    if (mean) heights[static_cast<std::size_t>(pole)] = RoundHeight(*mean);
  }
  return heights;
}

DemInfo Describe(GDALDataset& dataset, const std::string& path, const Georeference& georeference,
                 const RasterLayout& layout) {
  DemInfo info;
  info.path = path;
  info.driver = dataset.GetDriverName();
  info.width = layout.width;
  info.height = layout.height;
  info.data_type = GDALGetDataTypeName(HeightBand(dataset).GetRasterDataType());
  info.crs = georeference.crs();
  info.vertical_datum = georeference.vertical_datum();
  info.height_unit = layout.rules.unit;
  info.pixel_width = georeference.pixel_width();
  info.pixel_height = georeference.pixel_height();
  info.pixel_unit = georeference.pixel_unit();
  info.nodata = layout.rules.nodata;
  info.overview_factors = layout.overview_factors;
  info.transform = georeference.transform();
  return info;
}

void LogWhatMatters(GDALDataset& dataset, const DemInfo& info, const Georeference& georeference,
                    const RasterLayout& layout) {
  if (dataset.GetRasterCount() > 1) {
    spdlog::info("{}: has {} bands, heights are read from band 1", info.path, dataset.GetRasterCount());
  }
  if (!MetresPerUnit(layout.rules.unit)) {
    spdlog::warn("{}: height unit \"{}\" is not known, heights are taken as metres", info.path, layout.rules.unit);
  }
  if (info.vertical_datum.empty()) {
    spdlog::warn("{}: no vertical datum stated, heights pass through as given", info.path);
  }
  if (!info.transform.empty()) {
    spdlog::info("{}: placed by PROJ operation \"{}\": {}", info.path, info.transform, georeference.pipeline());
  }
}

}  // namespace

DemSource::DemSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
DemSource::~DemSource() = default;

Result<std::unique_ptr<DemSource>> DemSource::Open(const std::string& path, const DemOptions& options) {
  if (auto checked = CheckOptions(options); !checked)
    return MakeError(checked.error().code, "{}: {}", path, checked.error().message);
  const auto before = StampOf(path);
  auto dataset = OpenRaster(path);
  if (!dataset) return tl::unexpected(dataset.error());
  auto files = StampedFiles::OfOpened(FilesOf(**dataset, path), before);
  if (!files) return tl::unexpected(files.error());
  auto georeference = Georeference::Of(**dataset, path);
  if (!georeference) return tl::unexpected(georeference.error());
  const auto spacing = SourceSpacing::Of(*georeference, path);
  if (!spacing) return tl::unexpected(spacing.error());

  auto impl = std::make_unique<Impl>(path, *std::move(files), *std::move(georeference));
  impl->layout = LayoutOf(**dataset, impl->georeference);
  auto scan = ScanRaster(**dataset, impl->layout, options.progress, options.stop);
  if (!scan) return MakeError(scan.error().code, "{}: {}", path, scan.error().message);

  impl->info = Describe(**dataset, path, impl->georeference, impl->layout);
  const Footprint footprint = Footprint::Of(impl->georeference);
  impl->footprint = footprint.Padded();
  impl->levels = PlanLevels(*spacing);
  impl->mercator_factors = MercatorFactors(*spacing);
  impl->info.max_mercator_depth = DeepestMercator(*spacing);
  impl->info.max_level = DeepestLevel(*spacing, options.error_fraction, options.finest_error);
  impl->available = TilesTouching(footprint, impl->info.max_level);
  impl->table = std::move(scan->table);
  impl->floor = RoundHeight(options.floor.value_or(scan->lowest));
  impl->max_void_gap = options.max_void_gap;
  impl->pole_heights = PoleHeights(impl->georeference, *scan);
  impl->fingerprint = FingerprintOf(impl->handles.files(), options, impl->floor);

  impl->info.spacing_m = spacing->finer;
  impl->info.bounds = footprint.Bounds();
  impl->info.heights = {scan->lowest, scan->highest};
  impl->info.valid_samples = scan->valid;
  impl->info.void_samples = scan->voids;
  impl->info.floor = impl->floor;
  LogWhatMatters(**dataset, impl->info, impl->georeference, impl->layout);
  if (auto unchanged = impl->handles.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  return std::unique_ptr<DemSource>(new DemSource(std::move(impl)));
}

const DemInfo& DemSource::info() const { return impl_->info; }
int DemSource::max_level() const { return impl_->info.max_level; }
geo::Lattice DemSource::LatticeOf(int level) const { return impl_->Plan(level).lattice; }
std::uint64_t DemSource::fingerprint() const { return impl_->fingerprint; }
StampedFiles DemSource::files() const { return impl_->handles.files(); }

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
