#include "server/cli/common/open_dataset.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/statistics/cache_folder.h"
#include "server/cli/common/open_baked.h"

namespace terrace::cli {
namespace {

// A source's own options override those of its dataset.
dem::SourceOptions SourceOptionsOf(const config::DatasetConfig& dataset, const config::SourceConfig& source) {
  const config::NodataConfig nodata = source.nodata.value_or(dataset.nodata);
  dem::SourceOptions options;
  options.vertical = source.vertical.value_or(dataset.vertical);
  options.find_voids = nodata.detect;
  options.nodata = nodata.values;
  return options;
}

// All files of the sources. Each entry has its own rank.
std::vector<dem::DemFile> FilesOf(const config::DatasetConfig& dataset) {
  const std::vector<config::SourceConfig>& sources = dataset.sources;
  std::vector<dem::DemFile> files;
  for (std::size_t rank = 0; rank < sources.size(); ++rank) {
    for (const std::string& file : sources[rank].files) {
      files.push_back({file, static_cast<int>(rank), sources[rank].is_folder, SourceOptionsOf(dataset, sources[rank])});
    }
  }
  return files;
}

Result<tiler::WaterOptions> OpenWater(const config::WaterConfig& wanted, const dem::GeoBounds& bounds,
                                      const dem::FileContentOptions& content) {
  tiler::WaterOptions water;
  water.sea_level_m = wanted.sea_level;
  if (wanted.mask.empty()) return water;
  auto mask = dem::WaterRaster::Open(wanted.mask, bounds, content);
  if (!mask) {
    std::error_code unreadable;
    const bool exists = std::filesystem::exists(wanted.mask, unreadable);
    return MakeError(mask.error().code, "water mask {}{}", mask.error().message,
                     exists ? "" : ", or for a sea level a number of metres");
  }
  water.mask = *std::move(mask);
  return water;
}

Result<tiler::ImageryOptions> OpenImagery(const config::ImageryConfig& wanted, const dem::GeoBounds& bounds,
                                          const dem::FileContentOptions& content) {
  tiler::ImageryOptions imagery;
  if (wanted.image.empty()) return imagery;
  auto image = dem::Imagery::Open(wanted.image, bounds, content);
  if (!image) return MakeError(image.error().code, "imagery {}", image.error().message);
  imagery.image = *std::move(image);
  imagery.texture = wanted.texture;
  imagery.side = wanted.size;
  imagery.quality = wanted.quality;
  imagery.attribution = wanted.attribution;
  return imagery;
}

}  // namespace

Result<std::unique_ptr<dem::ElevationModel>> OpenModel(const config::DatasetConfig& wanted,
                                                       const dem::RasterCache& cache,
                                                       const std::function<void(double)>& progress,
                                                       std::stop_token stop, std::function<void(const Error&)> fault,
                                                       bool only_cached) {
  dem::DemOptions options;
  options.source = SourceOptionsOf(wanted, {});  // of the rasters of edits
  options.error_fraction = wanted.error_fraction;
  options.finest_error = wanted.finest_error;
  options.floor = wanted.floor;
  options.max_void_gap = wanted.max_void_gap;
  options.holes = wanted.voids;
  options.cache = cache;
  options.feather = wanted.feather;
  options.edits = wanted.edits;
  options.progress = progress;
  options.stop = std::move(stop);
  options.fault = std::move(fault);
  return only_cached ? dem::ElevationModel::OpenFromCache(FilesOf(wanted), options)
                     : dem::ElevationModel::Open(FilesOf(wanted), options);
}

Result<tiler::Dataset> MakeDataset(const config::DatasetConfig& wanted,
                                   std::shared_ptr<const dem::ElevationModel> model, const dem::RasterCache& cache,
                                   const std::string& version, std::stop_token stop) {
  const dem::GeoBounds bounds = model->info().bounds;
  if (!wanted.edits.empty() && model->info().edits == 0) {
    spdlog::warn(R"(dataset {}: its edits change nothing: no feature of {} has "terrain" in its properties)",
                 wanted.name, fmt::join(wanted.edits, ", "));
  }
  const dem::FileContentOptions content{cache.folder ? cache.folder->path() : std::string(), std::move(stop)};
  auto water = OpenWater(wanted.water, bounds, content);
  if (!water) return tl::unexpected(water.error());
  auto imagery = OpenImagery(wanted.imagery, bounds, content);
  if (!imagery) return tl::unexpected(imagery.error());
  tiler::Dataset dataset;
  dataset.name = wanted.name;
  dataset.attribution = wanted.attribution;
  dataset.error_fraction = wanted.error_fraction;
  dataset.mesh_options = {wanted.criterion, wanted.compact};
  dataset.glb.compression = wanted.glb_compression;
  dataset.glb.draco = {wanted.draco_speed, wanted.draco_normal_bits};
  dataset.glb.generator = "terrace " + version;
  dataset.model = std::move(model);
  dataset.water = *std::move(water);
  dataset.imagery = *std::move(imagery);
  dataset.metadata_availability = wanted.metadata_availability;
  dataset.generation = GenerationOf(dataset, dataset.model->fingerprint());
  if (dataset.model->info().edits > 0) {
    dataset.unedited_generation = GenerationOf(dataset, dataset.model->unedited_fingerprint());
  }
  return dataset;
}

Result<tiler::Dataset> OpenDataset(const config::DatasetConfig& wanted, const dem::RasterCache& cache,
                                   const std::string& version, const std::function<void(double)>& progress,
                                   std::stop_token stop) {
  if (wanted.sources.empty() && !wanted.baked.empty()) return OpenBakedAlone(wanted);
  auto model = OpenModel(wanted, cache, progress, stop);
  if (!model) return tl::unexpected(model.error());
  Result<tiler::Dataset> dataset = MakeDataset(wanted, *std::move(model), cache, version, std::move(stop));
  if (dataset) AddBaked(wanted, *dataset);
  return dataset;
}

Result<std::optional<tiler::Dataset>> OpenFromCache(const config::DatasetConfig& wanted, const dem::RasterCache& cache,
                                                    const std::string& version, const std::stop_token& stop) {
  if (wanted.sources.empty() && !wanted.baked.empty()) return OpenBakedAlone(wanted);
  auto model = OpenModel(wanted, cache, /*progress=*/{}, stop, /*fault=*/{}, /*only_cached=*/true);
  const bool lacks_statistics = !model && model.error().code == ErrorCode::kCancelled && !stop.stop_requested();
  if (lacks_statistics) return std::nullopt;
  if (!model) return tl::unexpected(model.error());
  Result<tiler::Dataset> dataset = MakeDataset(wanted, *std::move(model), cache, version, stop);
  if (!dataset) return tl::unexpected(dataset.error());
  AddBaked(wanted, *dataset);
  return *std::move(dataset);
}

}  // namespace terrace::cli
