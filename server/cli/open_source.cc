#include "server/cli/open_source.h"

#include <fmt/format.h>

namespace terrace::cli {

std::vector<dem::DemFile> FilesOf(const std::vector<config::SourceConfig>& sources) {
  std::vector<dem::DemFile> files;
  for (std::size_t rank = 0; rank < sources.size(); ++rank) {
    for (const std::string& file : sources[rank].files) {
      files.push_back({file, static_cast<int>(rank), sources[rank].is_folder});
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

Result<std::unique_ptr<dem::DemSource>> OpenSource(const config::DatasetConfig& wanted, const std::string& cache_dir,
                                                   const std::function<void(double)>& progress) {
  dem::DemOptions options;
  options.error_fraction = wanted.error_fraction;
  options.finest_error = wanted.finest_error;
  options.floor = wanted.floor;
  options.max_void_gap = wanted.max_void_gap;
  options.cache_dir = cache_dir;
  options.progress = progress;
  return dem::DemSource::Open(FilesOf(wanted.sources), options);
}

}  // namespace terrace::cli
