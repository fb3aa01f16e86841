// terrace info: what a raster holds, how deep it can be served, and what its owner should mend.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "engine/dem/dem_source.h"
#include "engine/geo/error_ladder.h"
#include "server/cli/command.h"
#include "server/cli/progress.h"

namespace terrace::cli {
namespace {

// Averages of half, a quarter .. of the samples take a third of them, in floats.
constexpr double kAveragesBytesPerSample = 4.0 / 3;

std::string NoOverviewsAdvice(const dem::RasterInfo& info) {
  if (info.prepared) return "no overviews: their place is taken by averages in the cache folder";
  return fmt::format(
      "no overviews: shallow tiles read the whole raster; run 'gdaladdo -r average {}', or serve with a cache_dir: its "
      "averages are then prepared there once, about {:.0f} MB in about {:.0f} s",
      info.path, std::ceil(static_cast<double>(info.valid_samples) * kAveragesBytesPerSample / 1e6),
      std::ceil(info.seconds_to_open));
}

// What a user should do about this raster; empty when nothing.
std::vector<std::string> AdviceFor(const dem::RasterInfo& info, double floor) {
  std::vector<std::string> advice;
  if (info.needs_averages) advice.push_back(NoOverviewsAdvice(info));
  if (info.vertical_datum.empty()) {
    advice.push_back(
        "no vertical datum stated: heights are taken as metres above the WGS 84 ellipsoid as they are; heights above "
        "mean "
        "sea level will be off by the geoid, up to 100 m");
  }
  if (info.void_samples > 0) {
    advice.push_back(
        fmt::format("voids: small ones are filled from their edges, larger ones show the floor of {:g} m", floor));
  }
  return advice;
}

std::string Percent(std::uint64_t part, std::uint64_t whole) {
  return fmt::format("{:.2g} %", whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0);
}

void PrintText(const dem::DemInfo& dataset) {
  const dem::RasterInfo& info = dataset.sources.front();
  const auto line = [](const char* what, const std::string& value) { fmt::print("  {:<14}{}\n", what, value); };
  fmt::print("{}\n", info.path);
  line("raster", fmt::format("{} x {}, {}, {}", info.width, info.height, info.data_type, info.driver));
  line("CRS", info.crs);
  line("pixel", fmt::format("{:g} x {:g} {}, {:.3g} m on the ground", info.pixel_width, info.pixel_height,
                            info.pixel_unit, info.spacing_m));
  line("bounds", fmt::format("west {:.6g}, south {:.6g}, east {:.6g}, north {:.6g}", info.bounds.west,
                             info.bounds.south, info.bounds.east, info.bounds.north));
  line("heights", fmt::format("{:g} to {:g} m{}", info.heights.min, info.heights.max,
                              info.height_unit.empty() ? "" : ", unit " + info.height_unit));
  line("datum", info.vertical_datum.empty() ? "not stated" : info.vertical_datum);
  line("voids", info.void_samples == 0
                    ? "none"
                    : fmt::format("{} samples, {}", info.void_samples,
                                  Percent(info.void_samples, info.valid_samples + info.void_samples)));
  line("overviews",
       info.overview_factors.empty() ? "none" : fmt::format("1/{}", fmt::join(info.overview_factors, ", 1/")));
  line("floor", fmt::format("{:g} m outside the raster and in large voids", dataset.floor));
  line("levels", fmt::format("0 to {}, default error {:.3g} m at the deepest", dataset.max_level,
                             geo::DefaultError(dataset.max_level)));
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
          {"pixel", {{"width", info.pixel_width}, {"height", info.pixel_height}, {"unit", info.pixel_unit}}},
          {"spacing_m", info.spacing_m},
          {"bounds", {info.bounds.west, info.bounds.south, info.bounds.east, info.bounds.north}},
          {"heights", {{"min", info.heights.min}, {"max", info.heights.max}}},
          {"valid_samples", info.valid_samples},
          {"void_samples", info.void_samples},
          {"overviews", info.overview_factors},
          {"floor", dataset.floor},
          {"levels", {0, dataset.max_level}},
          {"transform", info.transform},
          {"advice", AdviceFor(info, dataset.floor)}};
}

int Info(const std::vector<std::string>& dems, const std::string& cache_dir, bool json) {
  spdlog::set_level(spdlog::level::err);  // what opening logs is printed below
  int exit_code = kExitOk;
  nlohmann::json all = nlohmann::json::array();
  for (const std::string& path : dems) {
    Progress progress((cache_dir.empty() ? "reading " : "preparing ") + path);
    dem::DemOptions options;
    options.cache_dir = cache_dir;
    options.progress = progress.Callback();
    const auto source = dem::DemSource::Open(path, options);
    if (!source) {
      std::fprintf(stderr, "terrace: %s\n", source.error().message.c_str());
      exit_code = kExitFailure;
    } else if (json) {
      all.push_back(ToJson((*source)->info()));
    } else {
      PrintText((*source)->info());
    }
  }
  if (json) fmt::print("{}\n", all.dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  return exit_code;
}

}  // namespace

void AddInfo(CLI::App& app, int& exit_code) {
  auto dems = std::make_shared<std::vector<std::string>>();
  auto json = std::make_shared<bool>(false);
  auto cache_dir = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("info", "Tells what rasters hold, the levels they can serve, and what to mend");
  command->footer(
      "Examples:\n"
      "  terrace info alps.tif andes.tif\n"
      "  terrace info alps.tif --json\n\n"
      "A raster that cannot be served is told on stderr with the reason and the remedy; the others are still shown.");
  command->add_option("DEM", *dems, "Rasters that GDAL can read")->required();
  command->add_flag("--json", *json, "One JSON array instead of text");
  command->add_option("--cache-dir", *cache_dir, "Keeps what is learnt in this folder, for 'terrace serve --cache-dir'")
      ->type_name("DIR");
  command->callback([dems, json, cache_dir, &exit_code] { exit_code = Info(*dems, *cache_dir, *json); });
}

}  // namespace terrace::cli
