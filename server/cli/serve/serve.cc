// terrace serve: datasets from a config file and from the command line, over HTTP.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "config/common/working_directory.h"
#include "config/config.h"
#include "config/file/parse.h"
#include "config/options/options.h"
#include "engine/core/nearest_name.h"
#include "engine/gdal/gdal_runtime.h"
#include "server/cli/common/command.h"
#include "server/cli/common/option_flags.h"
#include "server/cli/serve/check_start.h"
#include "server/cli/serve/descriptor_plan.h"
#include "server/cli/serve/log.h"
#include "server/cli/serve/serve_config.h"
#include "server/cli/serve/serve_run.h"
#include "server/cli/serve/service_manager.h"
#include "server/server.h"
#include "tiler/tile/build_id.h"

namespace terrace::cli {
namespace {

int Report(const std::vector<config::ConfigError>& errors, const std::string& file) {
  const bool in_flags = std::ranges::all_of(errors, [](const auto& error) { return error.path.starts_with("--"); });
  const std::string place = file.empty() || in_flags ? "command" : "configuration " + file;
  std::fprintf(stderr, "terrace: %zu %s in the %s:\n", errors.size(),
               errors.size() == 1 ? "thing is wrong" : "things are wrong", place.c_str());
  for (const config::ConfigError& error : errors) std::fprintf(stderr, "  %s\n", error.Text().c_str());
  return kExitUsage;
}

// The configuration of the server: with the installed viewer, if the configuration asks for it.
config::Config WithViewer(config::Config config) {
  if (!config.viewer.enabled || !config.viewer.directory.empty()) return config;
  // Beside the binary if installed (PREFIX/bin), else in the build tree (BUILD/server/cli). The program contains no
  // path of the build: two builds in different folders are equal.
  std::error_code ignored;
  const std::filesystem::path binary = std::filesystem::read_symlink("/proc/self/exe", ignored);
  const std::filesystem::path above = binary.parent_path().parent_path();
  constexpr const char* kPlace = "share/terrace/viewer";
  config.viewer.directory = above / kPlace;
  if (!std::filesystem::exists(config.viewer.directory, ignored))
    config.viewer.directory = above.parent_path() / kPlace;
  return config;
}

// A wrong name is no error, because a reload may add the dataset. Clients with the token would be refused without a
// reason in the log.
void WarnAboutTokens(const config::Config& config) {
  std::vector<KnownName> known;
  for (const config::DatasetConfig& dataset : config.datasets) known.push_back({dataset.name});
  for (const config::TokenConfig& token : config.tokens) {
    for (const std::string& name : token.datasets) {
      if (std::ranges::find(known, name, &KnownName::name) != known.end()) continue;
      spdlog::warn("tokens: the token {} is for dataset {}, which is not there{}", token.name, name,
                   DidYouMean(Quoted(NearestNames(name, known))));
    }
  }
}

// No error, because a flag may switch off what an option of the file needs.
void WarnAboutUnusedOptions(const config::Config& config) {
  for (const config::ConfigError& unused : config::FindUnusedOptions(config)) spdlog::warn("{}", unused.Text());
}

int CheckConfig(const ServeArguments& arguments, const config::Config& config) {
  WarnAboutUnusedOptions(config);
  WarnAboutTokens(config);
  if (const int exit_code = CheckStart(config, WithViewer(config), PlanDescriptors(config), /*tries_address=*/false);
      exit_code != kExitOk)
    return exit_code;
  const std::size_t count = config.datasets.size();
  fmt::print(
      "terrace: the configuration{}{} is fine: {} dataset{}; rasters were not opened, 'terrace info' does that\n",
      arguments.config_file.empty() ? "" : " ", arguments.config_file, count, count == 1 ? "" : "s");
  return FinishOutput(kExitOk);
}

int Serve(const ServeArguments& arguments) {
  std::signal(SIGPIPE, SIG_IGN);  // the server continues if the reader of the log closes its pipe
  std::signal(SIGXFSZ, SIG_IGN);  // writing beyond a file size limit fails, as on a full disk
  std::vector<config::ConfigError> errors;
  const bool is_read_once = IsPipe(arguments.config_path);
  const config::Config config = MakeConfig(arguments, errors);
  if (!errors.empty()) return Report(errors, arguments.config_file);
  if (arguments.print_config) {
    std::fputs(config::ToJson(config).c_str(), stdout);
    return FinishOutput(kExitOk);
  }
  SetUpLog(config.log_level, config.log_format);
  if (arguments.check_config) return CheckConfig(arguments, config);
  const Result<std::optional<int>> passed = TakeListenSocket();
  if (!passed) return FailToStart(passed.error());
  BlockHandledSignals();  // log rotation may send them while sources are being opened
  tiler::BuildId();       // before GDAL or the system's resolver loads further libraries
  server::ServerOptions options;
  options.config = WithViewer(config);
  options.listen_socket = passed->value_or(-1);
  const bool tries_address = !passed->has_value();
  const Result<server::DescriptorBudget> budget = PlanDescriptors(config);
  if (const int exit_code = CheckStart(config, options.config, budget, tries_address); exit_code != kExitOk)
    return exit_code;
  WarnAboutFewDescriptors(config, *budget);
  if (std::error_code ignored;
      options.config.viewer.enabled && !std::filesystem::exists(options.config.viewer.directory, ignored)) {
    spdlog::warn("viewer: {} is not there: / lists the datasets; set `viewer` to a folder with its files, or to false",
                 options.config.viewer.directory.string());
  }
  WarnAboutUnusedOptions(config);
  WarnAboutTokens(config);
  options.config.max_connections = budget->connections;
  dem::SetGdalCache(config.gdal_cache_bytes);
  dem::SetOpenSources(budget->open_sources, budget->vrt_parts);

  ServeRun run(arguments, config, is_read_once);
  if (const Result<void> started = run.Start(std::move(options), budget->store_files); !started) {
    return FailToStart(started.error());
  }
  return run.ServeDatasets();
}

}  // namespace

void AddServe(CLI::App& app, int& exit_code) {
  auto arguments = std::make_shared<ServeArguments>();
  CLI::App* command =
      app.add_subcommand("serve", "Serves DEMs as terrain tiles over HTTP, with a viewer at /")->group(kCommands);
  command->footer(
      "Examples:\n"
      "  terrace serve alps.tif andes.tif\n"
      "  terrace serve baked/alps\n"
      "  terrace serve --config terrace.json --listen 0.0.0.0:8080\n\n"
      "Each DEM becomes a dataset named after its file; a folder of DEMs becomes one dataset. An\n"
      "archive of 'terrace bake' becomes the dataset that was baked. Options of\n"
      "the command line override those of the configuration. The server prints one line with its\n"
      "URL on stdout when all datasets are there; the log goes to stderr. SIGTERM or SIGINT ends the\n"
      "server after open requests are answered; a second signal ends it at once.");
  command->add_option("DEM", arguments->dems,
                      "Rasters that GDAL can read, folders of them, or archives; each is one dataset");
  command->add_option("--config", arguments->config_file, "Configuration in JSON; docs/configuration.md describes it")
      ->type_name("FILE");
  command->add_flag("--print-config", arguments->print_config,
                    "Prints the configuration with all defaults and options as JSON, and ends");
  command->add_flag("--check-config", arguments->check_config,
                    "Checks whether the server could start, without opening rasters or listening, and ends");
  AddFlags(*command, config::ServerOptionInfos(), "Server", arguments->server_flags);
  AddFlags(*command, config::DatasetOptionInfos(), "Datasets of the DEMs on the command line",
           arguments->dataset_flags);
  command->callback([arguments, &exit_code] {
    std::error_code unnamed;
    arguments->directory = std::filesystem::current_path(unnamed);
    if (!arguments->config_file.empty()) {
      arguments->config_path = config::FromWorkingDirectory(arguments->directory, arguments->config_file);
    }
    exit_code = Serve(*arguments);
  });
}

}  // namespace terrace::cli
