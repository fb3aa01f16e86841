#include "engine/sources/raster_source.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <utility>

#include "engine/common/source_log.h"
#include "engine/gdal/raster_file.h"
#include "engine/sources/located_raster.h"
#include "engine/sources/raster_warnings.h"
#include "engine/sources/sample_messages.h"

namespace terrace::dem {
namespace {

// Why overviews are not averages of valid heights only: many have averaged nodata values in them. Judged by what the
// file and its owner state.
std::string WhyMisleading(GDALDataset& dataset, const SampleRules& rules) {
  GDALRasterBand& band = HeightBand(dataset);
  const auto is_declared = [&](double value) { return rules.nodata && rules.IsSame(value, *rules.nodata); };
  if (!std::ranges::all_of(rules.extra_nodata, is_declared)) {
    return "they were made of samples too that `nodata` of the configuration calls voids; declare them in a copy with "
           "`gdal_translate -a_nodata VALUE in out` and make its overviews";
  }
  if (!rules.has_mask) return {};
  if (!HasMaskBand(band)) {
    return "they were made without regard to an alpha band of this type, which GDAL takes for no mask; make it one of "
           "bytes, and the overviews anew";
  }
  if (HasFileEndingWith(dataset, ".msk")) {
    return "they were made without regard to the mask in a file of its own; copy it with `gdal_translate --config "
           "GDAL_TIFF_INTERNAL_MASK YES in out` and make the copy's overviews";
  }
  return WhyOverviewsLackMasks(band);
}

// Removes from the layout the overviews that must not be read: those that include voids, by the nodata values of the
// file and the configuration, and those whose size is not that of a grid of averages. Returns the reason, with the
// remedy, for people; empty if nothing was removed.
std::string DropMisleadingOverviews(GDALDataset& dataset, RasterLayout& layout) {
  if (HeightBand(dataset).GetOverviewCount() == 0) return {};
  if (layout.overview_factors.empty()) {
    return "their sides are not those of the raster by 2, 4, 8 .., rounded up or down; `gdal_translate in out` without "
           "them and `gdaladdo -r average out` make such ones";
  }
  std::string why = WhyMisleading(dataset, layout.rules);
  if (!why.empty()) layout.overview_factors.clear();
  return why;
}

// The same, based on the statistics of the raster and its overviews.
std::string DropMisleadingOverviews(GDALDataset& dataset, const RasterStatistics& statistics, RasterLayout& layout) {
  if (layout.overview_factors.empty()) return {};
  if (statistics.voids == 0 && !statistics.has_stray_overviews) return {};
  const auto declared = DeclaredNodata(HeightBand(dataset));
  std::string why;
  if (statistics.voids == 0) {
    why =
        "they have heights that the samples around them have not, as if these were changed later; make them anew "
        "with `gdaladdo -clean file` and `gdaladdo -r average file`";
  } else if (layout.rules.nodata && !declared && !layout.rules.has_mask) {
    why =
        "they were made of voids too, which are not declared; declare them in a copy with "
        "`gdal_translate -a_nodata -32768 in out` and make its overviews";
  } else if (std::string other = WhyOverviewsHaveOtherNodata(HeightBand(dataset)); declared && !other.empty()) {
    why = std::move(other);
  } else if (statistics.has_stray_overviews && layout.rules.has_mask) {
    why =
        "they have heights that the raster has not there, as if they were made without its mask; copy it with "
        "`gdal_translate --config GDAL_TIFF_INTERNAL_MASK YES in out` and make the copy's overviews";
  } else if (statistics.has_stray_overviews) {
    why =
        "they have heights that the raster has not there, as if they were made of its voids too; make them anew with "
        "`gdaladdo -clean file` and `gdaladdo -r average file`";
  }
  if (!why.empty()) layout.overview_factors.clear();
  return why;
}

RasterInfo Describe(GDALDataset& dataset, const std::string& path, const Georeference& georeference,
                    const RasterLayout& layout) {
  RasterInfo info;
  info.path = path;
  info.driver = dataset.GetDriverName();
  info.width = layout.width;
  info.height = layout.height;
  info.data_type = GDALGetDataTypeName(HeightBand(dataset).GetRasterDataType());
  info.crs = georeference.crs();
  info.vertical_datum = georeference.vertical_datum();
  info.height_unit = layout.rules.unit;
  info.knows_height_unit = MetresPerUnit(layout.rules.unit).has_value();
  info.picture_color = PictureColorOf(HeightBand(dataset));
  info.pixel_width = georeference.pixel_width();
  info.pixel_height = georeference.pixel_height();
  info.pixel_unit = georeference.pixel_unit();
  info.nodata = layout.rules.nodata;
  info.overview_factors = layout.overview_factors;
  info.transform = georeference.transform();
  return info;
}

void LogWhatMatters(GDALDataset& dataset, const RasterInfo& info, const Georeference& georeference,
                    const RasterLayout& layout) {
  if (dataset.GetRasterCount() > 1) {
    LogSource(SourceLog::Level::kInfo, info.path, "has {} bands, heights are read from band 1",
              dataset.GetRasterCount());
  }
  if (!info.knows_height_unit) {
    LogSource(SourceLog::Level::kWarn, info.path, "height unit \"{}\" is not known, heights are taken as metres",
              layout.rules.unit);
  }
  if (!info.heights_doubted.empty()) LogSource(SourceLog::Level::kWarn, info.path, "{}", info.heights_doubted);
  if (!info.overviews_unused.empty()) {
    LogSource(SourceLog::Level::kWarn, info.path, "its overviews are not used: {}", info.overviews_unused);
  }
  for (const std::string& warning : info.warnings) {
    // Warnings that differ in numbers and names are of one kind.
    const std::string kind = warning.substr(0, warning.find_first_of("0123456789\"("));
    SourceLog::Write(SourceLog::Level::kWarn, kind, info.path, warning);
  }
  if (!info.picture_color.empty()) {
    LogSource(SourceLog::Level::kWarn, info.path,
              "is a picture (its band 1 is \"{}\"), whose values are taken for heights; serve the elevation model "
              "that belongs to it",
              info.picture_color);
  }
  if (!info.transform.empty()) {
    LogSource(SourceLog::Level::kDebug, info.path, "placed by PROJ operation \"{}\": {}", info.transform,
              georeference.pipeline());
  }
}

void LogVertical(const std::string& path, const VerticalDatum& vertical) {
  if (!vertical.geoid) return;
  LogSource(SourceLog::Level::kInfo, path, "heights are above {}, converted to the ellipsoid by PROJ operation \"{}\"",
            vertical.name, vertical.geoid->description());
  LogSource(SourceLog::Level::kDebug, path, "{}", vertical.geoid->pipeline());
}

constexpr const char* kGone = "a file is gone or cannot be read";

Position CentreOf(const Georeference& georeference) {
  Position centre{georeference.width() / 2.0, georeference.height() / 2.0};
  georeference.ToDegrees({&centre, 1});
  return centre;
}

}  // namespace

Result<std::unique_ptr<RasterSource>> RasterSource::Open(const std::string& path, const SourceOptions& options,
                                                         const RasterCache& cache,
                                                         const std::function<void(double)>& progress,
                                                         const std::stop_token& stop,
                                                         std::shared_ptr<StatisticsPages> pages, unsigned threads,
                                                         bool only_cached) {
  if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "{}: opening it was stopped", path);
  auto located = OpenLocatedRaster(path);
  if (!located) return tl::unexpected(located.error());
  GDALDataset& dataset = *located->dataset;

  std::unique_ptr<RasterSource> source(
      new RasterSource(path, std::move(located->files), std::move(located->georeference)));
  source->spacing_ = located->spacing;
  if (auto found = source->FindLayout(dataset, path, options); !found) return tl::unexpected(found.error());
  const PrepareOptions prepare{cache, options.find_voids, progress, stop, threads, only_cached};
  std::string overviews_unused;
  auto prepared = source->Prepare(dataset, path, prepare, overviews_unused);
  if (!prepared) return tl::unexpected(prepared.error());
  source->averages_ = prepared->averages;
  source->memory_averages_ = prepared->memory_averages;
  source->use_ = prepared->use;
  source->preparation_ = prepared->preparation;
  source->footprint_ = Footprint::Of(source->georeference_);
  source->FillInfo(dataset, path, *prepared);
  source->info_.overviews_unused = std::move(overviews_unused);
  source->info_.warnings = std::move(located->warnings);
  std::ranges::move(WarningsOf(dataset, source->georeference_, source->spacing_.finer, source->vertical_,
                               options.vertical, source->layout_),
                    std::back_inserter(source->info_.warnings));
  if (prepared->statistics.rim_voids.is_everything()) {
    source->info_.warnings.push_back(
        "its voids are too ragged to tell holes from collars around the data: none of them is smoothed over");
  }
  source->LogOpened(dataset);
  if (auto unchanged = source->CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  source->KeepStatistics(*std::move(prepared), prepare, std::move(pages));
  return source;
}

Result<void> RasterSource::FindLayout(GDALDataset& dataset, const std::string& path, const SourceOptions& options) {
  const std::string depths = AttributeOfDepths(*dataset.GetRasterBand(1));
  if (options.vertical == "crs" && !depths.empty()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: its band states \"{}\", so that its samples are depths; make heights of them with "
                     "`gdal_calc.py -A in --outfile=out --calc=-A`, and let `vertical` say what the heights count from",
                     path, depths);
  }
  auto vertical = ResolveVertical(options.vertical, georeference_, CentreOf(georeference_));
  if (!vertical) return MakeError(vertical.error().code, "{}: {}", path, vertical.error().message);
  vertical_ = *std::move(vertical);
  // If the file names no unit, the configured vertical reference system does.
  const std::string& stated = georeference_.vertical_unit();
  const auto& geoid = vertical_.geoid;
  layout_ = RasterLayout::Of(dataset, georeference_, stated.empty() && geoid != nullptr ? geoid->unit() : stated);
  if (auto scaled = CheckScale(layout_.rules, path); !scaled) return scaled;
  layout_.coast_step_m = ZeroEdges::CoastStep(spacing_.finer);
  layout_.rules.extra_nodata = options.nodata;
  return {};
}

Result<PreparedRaster> RasterSource::Prepare(GDALDataset& dataset, const std::string& path,
                                             const PrepareOptions& options, std::string& overviews_unused) {
  overviews_unused = DropMisleadingOverviews(dataset, layout_);
  auto prepared = PrepareRaster(dataset, layout_, path, files(), options);
  if (prepared && !prepared->detected.any()) {
    const std::string why = DropMisleadingOverviews(dataset, prepared->statistics, layout_);
    if (!why.empty()) {
      overviews_unused = why;
      prepared = PrepareRaster(dataset, layout_, path, files(), options);
    }
  }
  if (prepared) layout_ = WithDetectedNodata(std::move(layout_), prepared->detected);
  return prepared;
}

void RasterSource::FillInfo(GDALDataset& dataset, const std::string& path, const PreparedRaster& prepared) {
  const RasterStatistics& statistics = prepared.statistics;
  info_ = Describe(dataset, path, georeference_, layout_);
  info_.has_averages_in_cache_folder = averages_ != nullptr;
  if (averages_) info_.min_kept_factor = averages_->min_factor();
  if (memory_averages_) info_.min_kept_factor = memory_averages_->min_factor();
  info_.found_voids = prepared.detected.text;
  info_.blocks_too_wide = DescribeWideBlocks(dataset);
  info_.datum_in_use = vertical_.name;
  if (vertical_.geoid) info_.vertical_operation = vertical_.geoid->description();
  info_.spacing_m = spacing_.finer;
  info_.bounds = footprint_.Bounds();
  info_.heights = {statistics.lowest, statistics.highest};
  if (statistics.valid > 0) info_.heights_doubted = DoubtsOf(info_.heights);
  info_.valid_samples = statistics.valid;
  info_.void_samples = statistics.voids;
  info_.enclosed_samples = statistics.enclosed_samples;
}

void RasterSource::LogOpened(GDALDataset& dataset) const {
  LogWhatMatters(dataset, info_, georeference_, layout_);
  LogVertical(info_.path, vertical_);
  if (!info_.found_voids.empty()) {
    LogSource(SourceLog::Level::kWarn, info_.path,
              "voids that it does not declare: {}; `nodata` of the configuration decides otherwise", info_.found_voids);
  }
}

std::string RasterSource::DescribeLackOfHeights() const {
  return terrace::dem::DescribeLackOfHeights(layout_.rules, info_.path);
}

RasterSource::~RasterSource() {
  if (paging_) paging_->pages->paged.Erase(this);
}

// In a dataset of thousands of rasters, the statistics take most of the memory.
void RasterSource::KeepStatistics(PreparedRaster prepared, const PrepareOptions& prepare,
                                  std::shared_ptr<StatisticsPages> pages) {
  constexpr std::size_t kMaxCoarse = 64;  // blocks of a level
  RasterStatistics& statistics = prepared.statistics;
  content_ = statistics.content;
  edge_row_means_ = statistics.edge_row_means;
  rim_voids_ = std::move(statistics.rim_voids);
  if (pages == nullptr || prepared.cache_file.empty() || pages->kept.Take(statistics.bytes())) {
    kept_ = std::make_shared<const RasterStatistics>(std::move(statistics));
    return;
  }
  paging_ = std::make_unique<const Paging>(Paging{std::move(pages),
                                                  statistics.ranges.Coarse(kMaxCoarse),
                                                  !statistics.coarse.grids.empty(),
                                                  std::move(prepared.cache_file),
                                                  std::move(prepared.key),
                                                  {{prepare.cache.folder, nullptr}, prepare.find_voids, {}, {}}});
}

StatisticsPtr RasterSource::statistics() const {
  auto found = FindStatistics();
  if (!found) throw ThrownError(std::move(found.error()));
  return *std::move(found);
}

Result<StatisticsPtr> RasterSource::FindStatistics() const {
  if (kept_) return kept_;
  if (auto known = paging_->pages->paged.Find(this)) return known;
  auto statistics = ReadStatistics();
  if (!statistics) return tl::unexpected(std::move(statistics.error()));
  auto shared = std::make_shared<const RasterStatistics>(*std::move(statistics));
  paging_->pages->paged.Insert(this, shared, shared->bytes());
  return shared;
}

Result<RasterStatistics> RasterSource::ReadStatistics() const {
  if (auto known = LoadStatistics(paging_->cache_file, paging_->key)) return std::move(known->statistics);
  LogSource(SourceLog::Level::kWarn, info_.path, "{} is gone or damaged; the source is prepared anew",
            paging_->cache_file);
  auto handle = handles_.Borrow();
  if (!handle) return tl::unexpected(handle.error());
  auto prepared = PrepareRaster(**handle, paging_->key.layout, info_.path, files(), paging_->prepare);
  if (auto unchanged = handles_.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  if (!prepared) return tl::unexpected(prepared.error());
  // The next read would take as long.
  if (prepared->cache_file.empty() && !has_lost_cache_.exchange(true)) use_->Fail(kGone);
  return std::move(prepared->statistics);
}

BlockRange RasterSource::RangeIn(double west, double north, double east, double south) const {
  if (kept_) return kept_->ranges.Query(west, north, east, south);
  if (const auto known = paging_->ranges.TryQuery(west, north, east, south)) return *known;
  return statistics()->ranges.Query(west, north, east, south);
}

// Until the raster is reopened, it is read at full resolution.
void RasterSource::LoseCache(const Error& error) const {
  if (has_lost_cache_.exchange(true)) return;
  if (error.code == ErrorCode::kNotFound) {
    use_->Fail(kGone);
    return;
  }
  averages_->Discard();
  LogSource(SourceLog::Level::kWarn, info_.path, "{}; it is prepared anew when it is next opened", error.message);
}

Result<std::vector<float>> RasterSource::ReadAverages(int factor, const GridWindow& window,
                                                      const std::stop_token& stop) const {
  // Uses memory and the cache file only if the files have not changed since they were prepared.
  if (factor >= kLargestMeasuredFactor && (kept_ ? !kept_->coarse.grids.empty() : paging_->has_coarse_averages)) {
    if (auto unchanged = handles_.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
    const auto known = FindStatistics();
    if (!known) return tl::unexpected(known.error());
    if ((*known)->coarse.Has(factor)) return (*known)->coarse.Read(factor, window);
  }
  if (memory_averages_ && memory_averages_->Has(factor)) {
    if (auto unchanged = handles_.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
    return memory_averages_->Read(factor, window);
  }
  if (averages_ && averages_->Has(factor) && !has_lost_cache_) {
    if (auto unchanged = handles_.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
    auto averages = averages_->Read(factor, window);
    if (averages || averages.error().code == ErrorCode::kUnavailable) return averages;
    LoseCache(averages.error());
  }
  auto handle = handles_.Borrow();
  if (!handle) return tl::unexpected(handle.error());
  auto heights = dem::ReadAverages(**handle, layout_, factor, window, stop);
  // Files may be overwritten during a read: then both its result and its error are discarded.
  if (auto unchanged = handles_.CheckUnchanged(); !unchanged) return tl::unexpected(unchanged.error());
  if (!heights) return MakeError(heights.error().code, "{}: {}", info_.path, heights.error().message);
  return heights;
}

}  // namespace terrace::dem
