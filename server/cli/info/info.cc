// terrace info: the properties of a raster, its deepest level, and what to improve.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <vector>

#include "config/config.h"
#include "config/file/parse.h"
#include "config/options/options.h"
#include "engine/core/plain_number.h"
#include "engine/dem/elevation_model.h"
#include "engine/gdal/source_policy.h"
#include "engine/geo/error_ladder.h"
#include "engine/statistics/cache_folder.h"
#include "server/cli/common/command.h"
#include "server/cli/common/open_cache.h"
#include "server/cli/common/open_dataset.h"
#include "server/cli/common/option_flags.h"
#include "server/cli/common/progress.h"
#include "server/cli/common/replaced_file.h"
#include "server/cli/common/source_files.h"
#include "server/cli/info/edits_picture.h"
#include "server/cli/info/mosaic_info.h"
#include "tiler/encoder_version.h"

namespace terrace::cli {
namespace {

// Why shallow tiles are quick all the same, or how to make them so.
std::string NoOverviewsAdvice(const dem::RasterInfo& info) {
  constexpr int kQuick = 4;
  const std::string what =
      info.overviews_unused.empty() ? "no overviews" : fmt::format("overviews not used: {}", info.overviews_unused);
  if (info.has_averages_in_cache_folder) return what + "; their place is taken by averages in the cache folder";
  if (info.min_kept_factor > 0 && info.min_kept_factor <= kQuick) {
    return what + "; their place is taken by averages in memory, made at every start: a cache_dir would keep them";
  }
  return fmt::format("{}; shallow tiles read {}: give terrace a cache_dir with room, or run 'gdaladdo -r average {}'",
                     what, info.min_kept_factor > 0 ? "many samples" : "the whole raster", info.path);
}

// Advice about this raster; empty: none.
std::vector<std::string> AdviceFor(const dem::RasterInfo& info, double floor) {
  std::vector<std::string> advice;
  if (IsLargeWithoutOverviews(info)) {
    advice.push_back(NoOverviewsAdvice(info));
  } else if (!info.overviews_unused.empty()) {
    advice.push_back("overviews not used: " + info.overviews_unused);
  }
  if (!info.knows_height_unit) {
    advice.push_back(
        fmt::format("height unit \"{}\" is not known, heights are taken as metres: state metres a unit with "
                    "`gdal_translate -a_scale FACTOR in out`",
                    info.height_unit));
  }
  if (!info.heights_doubted.empty()) advice.push_back(info.heights_doubted);
  std::ranges::copy(info.warnings, std::back_inserter(advice));
  if (!info.blocks_too_wide.empty()) advice.push_back(info.blocks_too_wide);
  if (info.driver == "VRT") {
    advice.push_back(
        "a VRT, which names other files: 'terrace serve' takes it where allowed_drivers of its configuration lists "
        "\"VRT\"");
  }
  if (!info.picture_color.empty()) {
    advice.push_back(fmt::format(
        "band 1 says that it is the \"{}\" of a picture: its values are taken for heights, which they hardly "
        "are; serve the elevation model that belongs to it",
        info.picture_color));
  }
  if (!info.found_voids.empty()) {
    advice.push_back(fmt::format(
        "undeclared voids: {}; they are voids already: nothing has to be done. For other programs, mend the file",
        info.found_voids));
  }
  if (info.void_samples > 0) {
    advice.push_back(
        fmt::format("voids: small ones are filled from their edges, larger ones that have data all around them get a "
                    "smooth surface; those that touch the rim of the raster show the floor of {} m",
                    PlainNumber(floor)));
  }
  return advice;
}

std::string Percent(std::uint64_t part, std::uint64_t whole) {
  return PlainNumber(whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0, 2) + " %";
}

void PrintText(const dem::DemInfo& dataset) {
  const dem::RasterInfo& info = dataset.sources.front();
  const auto line = [](const char* what, const std::string& value) { fmt::print("  {:<14}{}\n", what, value); };
  fmt::print("{}\n", info.path);
  line("raster", fmt::format("{} x {}, {}, {}", info.width, info.height, info.data_type, info.driver));
  line("CRS", info.crs);
  line("pixel", fmt::format("{} x {} {}, {} m on the ground", PlainNumber(info.pixel_width),
                            PlainNumber(info.pixel_height), info.pixel_unit, PlainNumber(info.spacing_m, 3)));
  line("bounds", TextOfBounds(info.bounds));
  line("heights", fmt::format("{} to {} m{}", PlainNumber(info.heights.min), PlainNumber(info.heights.max),
                              info.height_unit.empty() ? "" : ", unit " + info.height_unit));
  line("datum", info.datum_in_use.empty() ? "not stated" : info.datum_in_use);
  if (!info.vertical_operation.empty()) {
    line("converted", fmt::format("by {}: {:.2f} to {:.2f} m above the ellipsoid, or less", info.vertical_operation,
                                  info.ellipsoidal.min, info.ellipsoidal.max));
  }
  line("voids",
       info.void_samples == 0
           ? "none"
           : fmt::format("{} samples, {}; {} of them with data all around", info.void_samples,
                         Percent(info.void_samples, info.valid_samples + info.void_samples), info.enclosed_samples));
  line("overviews",
       info.overview_factors.empty() ? "none" : fmt::format("1/{}", fmt::join(info.overview_factors, ", 1/")));
  line("floor", fmt::format("{} m outside the raster and in voids that touch its rim", PlainNumber(dataset.floor)));
  line("levels", fmt::format("0 to {}, default error {} m at the deepest", dataset.max_level,
                             PlainNumber(geo::DefaultError(dataset.max_level), 3)));
  if (!info.transform.empty()) line("transform", info.transform);
  for (const std::string& advice : AdviceFor(info, dataset.floor)) line("note", advice);
}

nlohmann::json ToJson(const dem::DemInfo& dataset) {
  const dem::RasterInfo& info = dataset.sources.front();
  return {{"path", info.path},
          {"driver", info.driver},
          {"width", info.width},
          {"height", info.height},
          {"data_type", info.data_type},
          {"crs", info.crs},
          {"vertical_datum", info.vertical_datum},
          {"counts_from", info.datum_in_use},
          {"vertical_operation", info.vertical_operation},
          {"ellipsoidal_heights", {{"min", info.ellipsoidal.min}, {"max", info.ellipsoidal.max}}},
          {"found_voids", info.found_voids},
          {"pixel", {{"width", info.pixel_width}, {"height", info.pixel_height}, {"unit", info.pixel_unit}}},
          {"spacing_m", info.spacing_m},
          {"bounds", {info.bounds.west, info.bounds.south, info.bounds.east, info.bounds.north}},
          {"heights", {{"min", info.heights.min}, {"max", info.heights.max}}},
          {"valid_samples", info.valid_samples},
          {"void_samples", info.void_samples},
          {"hole_samples", info.enclosed_samples},
          {"overviews", info.overview_factors},
          {"floor", dataset.floor},
          {"levels", {0, dataset.max_level}},
          {"transform", info.transform},
          {"advice", AdviceFor(info, dataset.floor)}};
}

// Each DEM is a dataset, or all of them are one.
std::vector<std::vector<config::SourceConfig>> Datasets(const std::vector<std::string>& dems, bool mosaic,
                                                        int& exit_code) {
  std::vector<std::vector<config::SourceConfig>> datasets;
  for (const std::string& dem : dems) {
    Result<config::SourceConfig> source = config::SourceAt(dem);
    if (!source) {
      std::fprintf(stderr, "terrace: %s\n", source.error().message.c_str());
      exit_code = kExitFailure;
    } else if (mosaic && !datasets.empty()) {
      datasets.front().push_back(*std::move(source));
    } else {
      datasets.push_back({*std::move(source)});
    }
  }
  return datasets;
}

struct InfoArguments {
  std::vector<std::string> dems;
  std::map<std::string, std::string> dataset_flags, cache_flags;  // by option key
  bool json = false, mosaic = false;
  std::string draw;  // file of a picture
};

// Writes the picture of a dataset's edits.
int Draw(const dem::ElevationModel& model, const std::string& path) {
  if (model.info().edits == 0) {
    return Fail(R"(--draw: there is nothing to draw: no feature has "terrain" in its properties)", kExitFailure);
  }
  const Result<std::string> png = DrawEdits(model);
  if (!png) return Fail(png.error().message, kExitFailure);
  Result<ReplacedFile> file = ReplacedFile::Open(path);
  if (!file) return Fail(file.error().message, kExitFailure);
  file->stream() << *png;
  const Result<void> written = file->Commit();
  return written ? kExitOk : Fail(written.error().message, kExitFailure);
}

// Whether the picture would replace a file that is read.
bool IsRead(const std::string& picture, const std::vector<std::vector<config::SourceConfig>>& datasets,
            const std::vector<std::string>& edits) {
  const auto is_picture = [&](const std::string& file) {
    std::error_code ignored;
    return std::filesystem::equivalent(picture, file, ignored);
  };
  for (const auto& sources : datasets) {
    for (const config::SourceConfig& source : sources) {
      if (std::ranges::any_of(source.files, is_picture)) return true;
    }
  }
  return std::ranges::any_of(edits, is_picture);
}

int Info(const InfoArguments& arguments) {
  spdlog::set_level(spdlog::level::err);  // what opening would log is printed below
  const auto& [dems, dataset_flags, cache_flags, json, mosaic, draw] = arguments;
  config::DatasetConfig flags;
  config::Config config;
  std::vector<config::ConfigError> wrong;
  std::error_code unnamed;
  const std::filesystem::path directory = std::filesystem::current_path(unnamed);
  for (const auto& [key, text] : dataset_flags) config::SetDatasetOption(key, text, directory, flags, wrong);
  for (const auto& [key, text] : cache_flags) config::SetServerOption(key, text, directory, config, wrong);
  if (!wrong.empty()) return Fail(wrong);
  int exit_code = dem::AllowVrts() ? kExitOk : kExitFailure;
  const dem::RasterCache cache = OpenStatisticsCache(config);
  std::string problem;
  nlohmann::json all = nlohmann::json::array();
  const auto datasets = Datasets(dems, mosaic, exit_code);
  if (!draw.empty() && flags.edits.empty()) return Fail("--draw shows edits; name them with --edits FILE", kExitUsage);
  if (!draw.empty() && datasets.size() > 1) {
    return Fail("--draw is for one dataset; give one DEM, or --mosaic", kExitUsage);
  }
  if (!draw.empty() && IsRead(draw, datasets, flags.edits)) {
    return Fail(fmt::format("--draw: {} is a file that is read; give the picture another name", draw), kExitUsage);
  }
  for (const auto& sources : datasets) {
    const std::string name = NameOf(sources);
    Progress progress((cache.folder ? "preparing " : "reading ") + name, FileCount(sources));
    config::DatasetConfig dataset = flags;
    dataset.sources = sources;
    std::vector<Error> faults;  // of all files
    auto opened =
        OpenModel(dataset, cache, progress.Callback(), {}, [&faults](const Error& fault) { faults.push_back(fault); });
    if (!opened) {
      if (faults.empty()) faults.push_back(opened.error());
      for (const Error& fault : faults) exit_code = Fail(fault.message, kExitFailure);
      continue;
    }
    if (cache.folder && problem.empty()) problem = cache.folder->problem();
    const std::shared_ptr<const dem::ElevationModel> model = *std::move(opened);
    const dem::DemInfo& info = model->info();
    const bool is_one = info.sources.size() == 1;
    const auto served = MakeDataset(dataset, model, cache, TERRACE_VERSION);
    if (!served) {
      exit_code = Fail(served.error().message, kExitFailure);
      continue;
    }
    const std::string version = tiler::VersionText(served->generation);
    if (json) {
      all.push_back(is_one ? ToJson(info) : nlohmann::json::parse(MosaicJson(name, info)));
      all.back()["left_out"] = info.left_out;
      all.back()["version"] = version;
      if (!dataset.edits.empty()) all.back()["edits"] = info.edits;
    } else {
      is_one ? PrintText(info) : PrintMosaic(name, info);
      fmt::print("  {:<14}{}\n", "version", version);
      if (!dataset.edits.empty()) fmt::print("  {:<14}{}\n", "edits", CountEdits(*model));
      for (const std::string& file : info.left_out) fmt::print("  {:<14}{}\n", "left out", file);
    }
    if (!draw.empty()) exit_code = std::max(exit_code, Draw(*model, draw));
  }
  if (!problem.empty()) {
    std::fprintf(stderr, "terrace: cache_dir %s: %s; new statistics are not saved\n", cache.folder->path().c_str(),
                 problem.c_str());
  }
  if (cache.folder) cache.folder->Trim();
  if (json) fmt::print("{}\n", all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  return exit_code;
}

}  // namespace

void AddInfo(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<InfoArguments>();
  CLI::App* command =
      app.add_subcommand("info", "Describes rasters, the levels they can serve, and what to improve")->group(kCommands);
  command->footer(
      "Examples:\n"
      "  terrace info alps.tif andes.tif\n"
      "  terrace info alps.tif --json\n"
      "  terrace info --mosaic lidar/ base.tif\n"
      "  terrace info dem.tif --edits airport.geojson --draw airport.png\n\n"
      "A raster that cannot be served is reported on stderr, with the reason and the remedy, and the others\n"
      "are described. A folder or a mosaic with such a raster in it is not described at all: as a dataset\n"
      "it could not be served.");
  command->add_option("DEM", arguments->dems, "Rasters that GDAL can read, or folders of them")->required();
  command->add_flag("--json", arguments->json, "Prints one JSON array instead of text");
  command->add_flag("--mosaic", arguments->mosaic,
                    "Describes all DEMs as one dataset; where they overlap, the first that has a height is used");
  command->add_option("--draw", arguments->draw, "Writes a picture of the edits: hill shade with the features")
      ->type_name("FILE.png");
  std::vector<config::OptionInfo> about_heights = config::DatasetOptionInfos();  // the others are about serving
  about_heights.erase(std::remove_if(about_heights.begin(), about_heights.end(),
                                     [](const auto& option) {
                                       return option.key != "vertical" && option.key != "nodata" &&
                                              option.key != "edits";
                                     }),
                      about_heights.end());
  AddFlags(*command, about_heights, "Heights, as for terrace serve", arguments->dataset_flags);
  std::vector<config::OptionInfo> about_cache = config::ServerOptionInfos();
  std::erase_if(about_cache, [](const auto& option) { return !option.key.starts_with("cache_dir"); });
  AddFlags(*command, about_cache, "Statistics of the rasters, as for terrace serve", arguments->cache_flags);
  command->callback([arguments, &exit_code] { exit_code = FinishOutput(Info(*arguments)); });
}

}  // namespace terrace::cli
