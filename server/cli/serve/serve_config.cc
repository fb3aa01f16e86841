#include "server/cli/serve/serve_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "config/common/working_directory.h"
#include "config/file/parse.h"
#include "config/options/options.h"
#include "engine/core/result.h"
#include "server/cli/common/open_baked.h"
#include "server/cli/common/source_files.h"

namespace terrace::cli {
namespace {

// A dataset of an archive alone keeps the name that it was baked under, and so its URLs.
Result<void> NameArchive(const std::string& place, config::DatasetConfig& dataset) {
  if (!dataset.baked.empty()) {
    return MakeError(ErrorCode::kInvalidArgument, "is an archive, and --baked names another; leave one out");
  }
  dataset.baked = place;
  const Result<std::string> name = NameOfBaked(place);
  if (!name) return tl::unexpected(name.error());
  if (dataset.name.empty()) dataset.name = config::SanitizeDatasetName(*name);
  return {};
}

// The DEMs of the command line are the last datasets of `config`. `dems`: the arguments as written. Each dataset is
// named after its file, so two may have the same name.
std::vector<config::ConfigError> FindSameNames(const config::Config& config, const std::vector<std::string>& dems) {
  const std::size_t configured = config.datasets.size() - dems.size();
  std::map<std::string_view, std::size_t> first_of;
  std::vector<config::ConfigError> errors;
  for (std::size_t i = 0; i < config.datasets.size(); ++i) {
    const config::DatasetConfig& dataset = config.datasets[i];
    const auto [first, is_new] = first_of.emplace(dataset.name, i);
    if (is_new) continue;
    const std::string& dem = dems[i - configured];
    if (first->second < configured) {
      errors.push_back({dem, fmt::format("would be dataset \"{}\", as one of the configuration is; {}", dataset.name,
                                         dems.size() == 1 ? "give it another name with --name NAME"
                                                          : "add it to the configuration with a name of its own")});
    } else if (config.datasets[first->second].sources == dataset.sources &&
               config.datasets[first->second].baked == dataset.baked) {
      errors.push_back({dem, "is given twice; leave one out"});
    } else {
      errors.push_back(
          {"", fmt::format("{} and {} would both be dataset \"{}\", as DEMs are named after their files and "
                           "archives after their datasets; name both in a configuration (--config)",
                           dems[first->second - configured], dem, dataset.name)});
    }
  }
  return errors;
}

// What an argument is that is no DEM: a configuration, a file of an archive, baked tiles; empty for everything else.
// `path` is `written` as an absolute path.
std::string ExplainOtherThanDem(const std::string& written, const std::string& path) {
  const std::filesystem::path place(path);
  std::error_code ignored;
  if (place.filename() == "manifest.json" && IsArchive(place.parent_path().string())) {
    const std::string folder = std::filesystem::path(written).parent_path().string();
    return fmt::format("{} is a file of an archive; name its folder: terrace serve {}", written,
                       folder.empty() ? "." : folder);
  }
  const std::filesystem::path folder = place.parent_path();
  if (place.filename() == "top.pmtiles" && IsArchive(folder.string())) {
    return fmt::format("{} is a file of an archive; name its folder: terrace serve {}", written, folder.string());
  }
  if (place.extension() == ".pmtiles" && folder.filename() == "units" && IsArchive(folder.parent_path().string())) {
    return fmt::format("{} is a file of an archive; name its folder: terrace serve {}", written,
                       folder.parent_path().string());
  }
  if (std::filesystem::exists(place / "bake.json", ignored) && !IsArchive(path)) {
    return fmt::format(
        "{} is a bake that has not finished: it has no manifest; run the same 'terrace bake' again to go on", written);
  }
  if (written.starts_with("/vsi") && !place.has_extension()) {
    return fmt::format(
        "{} has no extension, so it is no raster; name an archive in a bucket in a configuration: \"baked\": \"{}\", "
        "and its bucket in allowed_prefixes",
        written, written);
  }
  if (written.ends_with(".json")) {
    return fmt::format("{} looks like a configuration: terrace serve --config {}", written, written);
  }
  if (place.extension() == ".3tz") {
    return fmt::format(
        "{} has 3D Tiles for other programs; terrace serve needs the chunks of a bake without --form, or a file of "
        "--form single",
        written);
  }
  for (const auto& [document, tiles] :
       {std::pair{"layer.json", "0"}, {"tiles.json", "0"}, {"tileset.json", "3dtiles"}}) {
    if (std::filesystem::exists(place / document, ignored) && std::filesystem::is_directory(place / tiles, ignored)) {
      return fmt::format(
          "{} has tiles of 'terrace bake --form folder', which any file server serves: docs/baking.md, \"A static "
          "host\"; "
          "terrace serve needs the chunks of a bake without --form",
          written);
    }
  }
  return {};
}

// Adds a dataset for a DEM or an archive of the command line. `flags`: options of such datasets. Returns false if the
// argument can be neither.
bool AddDem(const std::string& written, const std::filesystem::path& directory, const config::DatasetConfig& flags,
            config::Config& config, std::vector<config::ConfigError>& errors) {
  if (written.empty()) {
    errors.push_back({"", "a DEM on the command line has an empty name"});
    return false;
  }
  const std::string dem = config::FromWorkingDirectory(directory, written);
  if (std::string other = ExplainOtherThanDem(written, dem); !other.empty()) {
    errors.push_back({"", std::move(other)});
    return false;
  }
  if (std::filesystem::path(dem).is_relative()) {
    errors.push_back({written, config::kNoWorkingDirectory});
    return false;
  }
  config::DatasetConfig& dataset = config.datasets.emplace_back(flags);
  if (IsArchive(dem)) {
    if (const Result<void> named = NameArchive(dem, dataset); !named) {
      errors.push_back({written, named.error().message});
    }
    return true;
  }
  if (dataset.name.empty()) dataset.name = DatasetNameOf(dem);
  Result<config::SourceConfig> source = config::SourceAt(dem);
  if (source)
    dataset.sources = {*std::move(source)};
  else
    errors.push_back({written, source.error().message});
  return true;
}

}  // namespace

bool IsPipe(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_other(path, ignored);
}

config::Config MakeConfig(const ServeArguments& arguments, std::vector<config::ConfigError>& errors) {
  config::Config config;
  if (!arguments.config_file.empty()) {
    config::ConfigResult loaded = config::LoadConfig(arguments.config_path);
    if (loaded)
      config = *std::move(loaded);
    else
      errors = std::move(loaded).error();
  }
  for (const auto& [key, text] : arguments.server_flags) {
    config::SetServerOption(key, text, arguments.directory, config, errors);
  }
  for (const auto& [key, text] : arguments.dataset_flags) {
    if (!arguments.dems.empty()) break;
    errors.push_back({config::FlagOf(key),
                      fmt::format("is for DEMs of the command line, of which there are none; for a dataset of the "
                                  "configuration write \"{}\" there",
                                  key)});
  }
  if (arguments.dems.size() > 1 && arguments.dataset_flags.contains("name")) {
    errors.push_back({"--name", "names one dataset; give one DEM, or a config file with a name for each"});
  }
  config::DatasetConfig flags;  // checked once, however many DEMs they apply to
  for (const auto& [key, text] : arguments.dataset_flags) {
    config::SetDatasetOption(key, text, arguments.directory, flags, errors);
  }
  std::vector<std::string> taken;  // the DEMs that became datasets
  for (const std::string& written : arguments.dems) {
    if (AddDem(written, arguments.directory, flags, config, errors)) taken.push_back(written);
  }
  if (errors.empty()) errors = FindSameNames(config, taken);
  if (errors.empty() && config.datasets.empty() && !arguments.print_config) {
    errors.push_back(
        {"", arguments.config_file.empty()
                 ? "there is nothing to serve; name a DEM ('terrace serve dem.tif') or a config file (--config)"
                 : "there is nothing to serve; it needs an entry in \"datasets\""});
  }
  return config;
}

}  // namespace terrace::cli
