#include "server/cli/open_source.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "engine/dem/gdal/source_policy.h"

namespace terrace::cli {

namespace {

// What the dataset says and its source does not contradict.
dem::SourceOptions OptionsOf(const config::DatasetConfig& dataset, const config::SourceConfig& source) {
  const config::NodataConfig nodata = source.nodata.value_or(dataset.nodata);
  dem::SourceOptions options;
  options.vertical = source.vertical.value_or(dataset.vertical);
  options.find_voids = nodata.detect;
  options.nodata = nodata.values;
  return options;
}

}  // namespace

std::vector<dem::DemFile> FilesOf(const config::DatasetConfig& dataset) {
  const std::vector<config::SourceConfig>& sources = dataset.sources;
  std::vector<dem::DemFile> files;
  for (std::size_t rank = 0; rank < sources.size(); ++rank) {
    for (const std::string& file : sources[rank].files) {
      files.push_back({file, static_cast<int>(rank), sources[rank].is_folder, OptionsOf(dataset, sources[rank])});
    }
  }
  return files;
}

std::size_t FileCount(const std::vector<config::SourceConfig>& sources) {
  std::size_t count = 0;
  for (const config::SourceConfig& source : sources) count += source.files.size();
  return count;
}

std::string NameOf(const std::vector<config::SourceConfig>& sources) {
  if (sources.size() == 1) return sources.front().written;
  return fmt::format("{} and {} more source{}", sources.front().written, sources.size() - 1,
                     sources.size() == 2 ? "" : "s");
}

Result<void> TryReading(const config::DatasetConfig& dataset) {
  const auto read = [&](const std::string& path, const char* remedy) -> Result<void> {
    // Other names are GDAL's to resolve.
    if (!path.starts_with('/') || path.starts_with("/vsi") || ::access(path.c_str(), R_OK) == 0) return {};
    return MakeError(ErrorCode::kNotFound, "dataset {}: {}: {}; give the path of a raster file on this machine{}",
                     dataset.name, path, std::generic_category().message(errno), remedy);
  };
  for (const config::SourceConfig& source : dataset.sources) {
    for (const std::string& file : source.files) {
      if (Result<void> readable = read(file, ""); !readable) return readable;
    }
  }
  if (Result<void> readable = read(dataset.imagery.image, ""); !readable) return readable;
  return read(dataset.water.mask, ", or for a sea level a number of metres");
}

Result<void> TryPolicy(const config::DatasetConfig& dataset) {
  const auto checked = [&](const Result<void>& allowed) -> Result<void> {
    if (allowed) return {};
    return MakeError(allowed.error().code, "dataset {}: {}", dataset.name, allowed.error().message);
  };
  for (const config::SourceConfig& source : dataset.sources) {
    for (const std::string& file : source.files) {
      if (source.is_folder && !dem::IsOneLine(file)) continue;  // left out, and told
      // What a folder has besides rasters is left out when it is opened, whatever it is.
      const Result<void> allowed = source.is_folder ? dem::CheckPlainFile(file) : dem::CheckSourceName(file);
      if (!allowed) return checked(allowed);
    }
  }
  for (const std::string* layer : {&dataset.imagery.image, &dataset.water.mask}) {
    if (layer->empty()) continue;
    if (const Result<void> allowed = dem::CheckSourceName(*layer); !allowed) return checked(allowed);
  }
  return {};
}

Result<std::unique_ptr<dem::DemSource>> OpenSource(const config::DatasetConfig& wanted, const std::string& cache_dir,
                                                   const std::function<void(double)>& progress, std::stop_token stop,
                                                   std::function<void(const Error&)> fault) {
  dem::DemOptions options;
  options.error_fraction = wanted.error_fraction;
  options.finest_error = wanted.finest_error;
  options.floor = wanted.floor;
  options.max_void_gap = wanted.max_void_gap;
  options.voids = wanted.voids == config::HoleFill::kSmooth ? dem::HoleFill::kSmooth : dem::HoleFill::kFloor;
  options.cache_dir = cache_dir;
  options.feather = wanted.feather;
  options.progress = progress;
  options.stop = std::move(stop);
  options.fault = std::move(fault);
  return dem::DemSource::Open(FilesOf(wanted), options);
}

}  // namespace terrace::cli
