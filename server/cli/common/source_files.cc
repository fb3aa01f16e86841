#include "server/cli/common/source_files.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "engine/core/errno_text.h"
#include "engine/core/nearest_name.h"
#include "engine/gdal/source_policy.h"

namespace terrace::cli {
namespace {

// "; did you mean dem.tif?" for a missing file with a similar name beside it; empty if there is none.
std::string SimilarFile(const std::string& path) {
  constexpr int kMaxFiles = 1000;  // of a folder: a suggestion must not take long
  const std::filesystem::path wanted(path);
  std::vector<std::string> names;
  std::error_code error;
  for (std::filesystem::directory_iterator entry(wanted.parent_path(), error), end; !error && entry != end;
       entry.increment(error)) {
    if (names.size() == kMaxFiles) return "";
    names.push_back(entry->path().filename().string());
  }
  std::ranges::sort(names);  // the order of a folder is not fixed
  std::vector<KnownName> known;
  for (const std::string& name : names) known.push_back({name});
  const std::vector<std::string_view> similar = NearestNames(wanted.filename().string(), known);
  return similar.empty() ? "" : fmt::format("; did you mean {}?", similar.front());
}

}  // namespace

std::string DatasetNameOf(const std::string& dem) {
  std::error_code ignored;
  const std::filesystem::path path = std::filesystem::path(dem).lexically_normal();
  const bool is_folder = std::filesystem::is_directory(path, ignored);
  const std::filesystem::path named = path.has_filename() ? path : path.parent_path();
  return config::SanitizeDatasetName((is_folder ? named.filename() : path.stem()).string());
}

std::size_t FileCount(const std::vector<config::SourceConfig>& sources) {
  std::size_t count = 0;
  for (const config::SourceConfig& source : sources) count += source.files.size();
  return count;
}

std::string NameOf(const config::DatasetConfig& dataset) {
  return dataset.sources.empty() ? dataset.baked : NameOf(dataset.sources);
}

std::string NameOf(const std::vector<config::SourceConfig>& sources) {
  if (sources.size() == 1) return sources.front().path;
  return fmt::format("{} and {} more source{}", sources.front().path, sources.size() - 1,
                     sources.size() == 2 ? "" : "s");
}

Result<void> CheckReadable(const config::DatasetConfig& dataset) {
  const auto read = [&](const std::string& path, const char* remedy) -> Result<void> {
    // GDAL resolves other names.
    if (!path.starts_with('/') || path.starts_with("/vsi") || ::access(path.c_str(), R_OK) == 0) return {};
    const int reason = errno;
    return MakeError(ErrorCode::kNotFound, "dataset {}: {}: {}; give the path of a raster file on this machine{}{}",
                     dataset.name, path, ErrorText(reason), remedy, reason == ENOENT ? SimilarFile(path) : "");
  };
  const auto read_grid = [&](const std::string& vertical) -> Result<void> {
    if (!vertical.starts_with('/') || ::access(vertical.c_str(), R_OK) == 0) return {};
    const int reason = errno;
    return MakeError(ErrorCode::kNotFound, "dataset {}: vertical: {}: {}; name a grid of undulations, or a datum{}",
                     dataset.name, vertical, ErrorText(reason), reason == ENOENT ? SimilarFile(vertical) : "");
  };
  if (Result<void> readable = read_grid(dataset.vertical); !readable) return readable;
  for (const config::SourceConfig& source : dataset.sources) {
    if (Result<void> readable = read_grid(source.vertical.value_or("")); !readable) return readable;
    for (const std::string& file : source.files) {
      if (Result<void> readable = read(file, ""); !readable) return readable;
    }
  }
  const bool is_local = dataset.baked.starts_with('/') && !dataset.baked.starts_with("/vsi");
  if (dataset.sources.empty() && is_local && ::access(dataset.baked.c_str(), R_OK) != 0) {
    return MakeError(ErrorCode::kNotFound,
                     "dataset {}: {}: {}; give the folder or file that 'terrace bake' wrote, or \"sources\"",
                     dataset.name, dataset.baked, ErrorText());
  }
  for (const std::string& file : dataset.edits) {
    if (::access(file.c_str(), R_OK) == 0) continue;
    const int reason = errno;
    return MakeError(ErrorCode::kNotFound, "dataset {}: edits: {}: {}; name a GeoJSON file{}", dataset.name, file,
                     ErrorText(reason), reason == ENOENT ? SimilarFile(file) : "");
  }
  if (Result<void> readable = read(dataset.imagery.image, ""); !readable) return readable;
  return read(dataset.water.mask, ", or for a sea level a number of metres");
}

Result<void> CheckEditFiles(const config::DatasetConfig& dataset) {
  for (const std::string& file : dataset.edits) {
    std::error_code ignored;
    const std::filesystem::file_status status = std::filesystem::status(file, ignored);
    if (!std::filesystem::exists(status) || std::filesystem::is_regular_file(status)) continue;
    return MakeError(ErrorCode::kInvalidArgument, "dataset {}: edits: {}: not a regular file; name a GeoJSON file",
                     dataset.name, file);
  }
  return {};
}

Result<void> CheckSourcePolicy(const config::DatasetConfig& dataset) {
  const auto checked = [&](const Result<void>& allowed) -> Result<void> {
    if (allowed) return {};
    return MakeError(allowed.error().code, "dataset {}: {}", dataset.name, allowed.error().message);
  };
  for (const config::SourceConfig& source : dataset.sources) {
    for (const std::string& file : source.files) {
      if (source.is_folder && !dem::IsOneLine(file)) continue;  // left out, with a message
      // Other files of a folder are left out when it is opened.
      const Result<void> allowed = source.is_folder ? dem::CheckPlainFile(file) : dem::CheckSourceName(file);
      if (!allowed) return checked(allowed);
    }
  }
  std::vector<std::string> verticals = {dataset.vertical};
  for (const config::SourceConfig& source : dataset.sources) verticals.push_back(source.vertical.value_or(""));
  for (const std::string& vertical : verticals) {
    std::error_code ignored;  // as dem::ResolveVertical: a grid of undulations
    if (!std::filesystem::exists(vertical, ignored)) continue;
    if (const Result<void> allowed = dem::CheckPlainFile(vertical); !allowed) return checked(allowed);
  }
  for (const std::string* layer : {&dataset.imagery.image, &dataset.water.mask}) {
    if (layer->empty()) continue;
    if (const Result<void> allowed = dem::CheckSourceName(*layer); !allowed) return checked(allowed);
  }
  return {};
}

}  // namespace terrace::cli
