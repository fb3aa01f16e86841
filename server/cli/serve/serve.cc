// terrace serve: datasets from a config file and from the command line, over HTTP.
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "config/common/working_directory.h"
#include "config/config.h"
#include "config/config_watch.h"
#include "config/options/options.h"
#include "config/parse.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/statistics/cache_folder.h"
#include "server/cli/common/command.h"
#include "server/cli/common/open_baked.h"
#include "server/cli/common/open_cache.h"
#include "server/cli/common/open_dataset.h"
#include "server/cli/common/option_flags.h"
#include "server/cli/common/progress.h"
#include "server/cli/common/source_files.h"
#include "server/cli/serve/check_start.h"
#include "server/cli/serve/descriptor_plan.h"
#include "server/cli/serve/log.h"
#include "server/cli/serve/service_manager.h"
#include "server/memory_trimmer.h"
#include "server/reload/reloader.h"
#include "server/server.h"
#include "server/store/baked_store.h"
#include "server/store/disk_cache.h"
#include "server/store/shared_cache.h"
#include "server/tiles/catalog.h"
#include "tiler/build_id.h"
#include "tiler/encoder_version.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {
namespace {

struct ServeArguments {
  std::filesystem::path directory;  // the working directory at the start; empty: it has no name
  std::vector<std::string> dems;
  std::string config_file, config_path;  // as given; absolute
  bool print_config = false, check_config = false;
  std::map<std::string, std::string> server_flags, dataset_flags;  // by option key
};

int Report(const std::vector<config::ConfigError>& errors, const std::string& file) {
  const bool in_flags = std::ranges::all_of(errors, [](const auto& error) { return error.path.starts_with("--"); });
  const std::string place = file.empty() || in_flags ? "command" : "configuration " + file;
  std::fprintf(stderr, "terrace: %zu %s in the %s:\n", errors.size(),
               errors.size() == 1 ? "thing is wrong" : "things are wrong", place.c_str());
  for (const config::ConfigError& error : errors) {
    std::fprintf(stderr, "  %s%s%s\n", error.path.c_str(), error.path.empty() ? "" : ": ", error.message.c_str());
  }
  return kExitUsage;
}

// A file that can be read only once, or endlessly.
bool IsPipe(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_other(path, ignored);
}

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
    } else if (config.datasets[first->second].sources == dataset.sources) {
      errors.push_back({dem, "is given twice; leave one out"});
    } else {
      errors.push_back({"", fmt::format("{} and {} would both be dataset \"{}\", as DEMs are named after their files; "
                                        "rename one, or name both in a configuration (--config)",
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
  if (written.ends_with(".json")) {
    return fmt::format("{} looks like a configuration: terrace serve --config {}", written, written);
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

// Applies the file's options, then the flags, then adds a dataset per DEM of the command line. Collects all errors.
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
    if (written.empty()) {
      errors.push_back({"", "a DEM on the command line has an empty name"});
      continue;
    }
    const std::string dem = config::FromWorkingDirectory(arguments.directory, written);
    if (std::string other = ExplainOtherThanDem(written, dem); !other.empty()) {
      errors.push_back({"", std::move(other)});
      continue;
    }
    if (std::filesystem::path(dem).is_relative()) {
      errors.push_back({written, config::kNoWorkingDirectory});
      continue;
    }
    taken.push_back(written);
    config::DatasetConfig& dataset = config.datasets.emplace_back(flags);
    if (IsArchive(dem)) {
      if (const Result<void> named = NameArchive(dem, dataset); !named) {
        errors.push_back({written, named.error().message});
      }
      continue;
    }
    if (dataset.name.empty()) dataset.name = DatasetNameOf(dem);
    Result<config::SourceConfig> source = config::SourceAt(dem);
    if (source)
      dataset.sources = {*std::move(source)};
    else
      errors.push_back({written, source.error().message});
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

// Opens every source. Returns false if one failed, after the errors of all were printed, or if it was stopped.
bool OpenDatasets(const config::Config& config, const dem::RasterCache& cache, const std::stop_token& stop,
                  std::vector<tiler::Dataset>& datasets) {
  bool all_open = true;
  for (const config::DatasetConfig& wanted : config.datasets) {
    Progress progress((cache.folder ? "preparing " : "reading ") + NameOf(wanted), FileCount(wanted.sources));
    Result<tiler::Dataset> dataset = OpenDataset(wanted, cache, TERRACE_VERSION, progress.Callback(), stop);
    if (stop.stop_requested()) return false;
    if (!dataset) {
      std::fprintf(stderr, "terrace: dataset %s: %s\n", wanted.name.c_str(), dataset.error().message.c_str());
      all_open = false;
      continue;
    }
    const int max_level = dataset->source ? dataset->source->max_level()
                                          : static_cast<int>(dataset->baked->extent().available.size()) - 1;
    const std::string archive = dataset->source && dataset->baked ? ", archive " + wanted.baked : "";
    spdlog::info("dataset {}: {}{}, levels 0 to {}, version {}", dataset->name, NameOf(wanted), archive, max_level,
                 tiler::VersionText(dataset->generation));
    datasets.push_back(*std::move(dataset));
  }
  return all_open;
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

// The time that stopping may take beyond the delay and timeout of the drain.
constexpr std::chrono::seconds kStopTime{1};

// Limits the time that the process takes to stop. Jobs check their stop tokens, but a read from a dead mount never
// returns, and its thread cannot be joined.
class ShutdownWatchdog {
 public:
  // Ends the process with status 1 after `limit`, whatever its threads do. Call once.
  void Begin(std::chrono::milliseconds limit) {
    thread_ = std::jthread([limit](const std::stop_token& stop) {
      std::mutex mutex;
      std::unique_lock lock(mutex);
      std::condition_variable_any().wait_for(lock, stop, limit, [] { return false; });
      if (stop.stop_requested()) return;
      spdlog::error(
          "stopped: threads that still worked {} s after the signal were cut off; look whether a source can be read",
          std::chrono::duration<double>(limit).count());
      spdlog::default_logger()->flush();
      std::_Exit(kExitFailure);
    });
  }

 private:
  std::jthread thread_;  // ends with this object
};

// Signals that the running server handles, except those that end it.
const std::vector<int> kAnsweredSignals = {SIGUSR1, SIGUSR2, SIGHUP};

// `how`: SIG_BLOCK or SIG_UNBLOCK. For this thread and threads that it starts.
void MaskSignals(int how, const std::vector<int>& signals) {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : signals) ::sigaddset(&set, signal);
  ::pthread_sigmask(how, &set, nullptr);
}

int CheckConfig(const ServeArguments& arguments, const config::Config& config) {
  if (const int exit_code = CheckStart(config, WithViewer(config), PlanDescriptors(config), /*tries_address=*/false);
      exit_code != kExitOk)
    return exit_code;
  const std::size_t count = config.datasets.size();
  fmt::print(
      "terrace: the configuration{}{} is fine: {} dataset{}; rasters were not opened, 'terrace info' does that\n",
      arguments.config_file.empty() ? "" : " ", arguments.config_file, count, count == 1 ? "" : "s");
  return FinishOutput(kExitOk);
}

// Exit code 1, also for kInvalidArgument: the command line was accepted.
int FailToStart(const Error& error) {
  std::fprintf(stderr, "terrace: %s\n", error.message.c_str());
  return kExitFailure;
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
  // Until handlers are installed, these signals would end the process; log rotation may send them while sources are
  // being opened.
  MaskSignals(SIG_BLOCK, kAnsweredSignals);
  tiler::BuildId();  // before GDAL or the system's resolver loads further libraries
  server::ServerOptions options;
  options.config = WithViewer(config);
  options.stop_on_signals = true;
  options.listen_socket = passed->value_or(-1);
  const bool tries_address = !passed->has_value();
  const Result<server::DescriptorBudget> budget = PlanDescriptors(config);
  if (const int exit_code = CheckStart(config, options.config, budget, tries_address); exit_code != kExitOk)
    return exit_code;
  WarnAboutFewDescriptors(config, *budget);
  options.config.max_connections = budget->connections;
  dem::SetGdalCache(config.gdal_cache_bytes);
  dem::SetOpenSources(budget->open_sources, budget->vrt_parts);

  ShutdownWatchdog watchdog;  // first, because it limits how long the others take to end
  Result<server::DiskCache> disk;
  if (!config.disk_cache.directory.empty()) disk = server::OpenDiskCache(config.disk_cache, budget->store_files);
  if (!disk) return FailToStart(disk.error());
  // Archives first: the disk cache then keeps no copies of their tiles.
  const auto baked = std::make_shared<server::BakedStore>();
  options.tile_stores.push_back(baked);
  if (disk->tiles) options.tile_stores.push_back(std::move(disk->tiles));
  if (!config.shared_cache.url.empty()) {
    auto shared = server::OpenSharedCache(config.shared_cache, WorkerThreads(config));
    if (!shared) return FailToStart(shared.error());
    options.tile_stores.push_back(*std::move(shared));
  }
  options.refinements =
      std::make_shared<tiler::RefinementCache>(config.refinement_cache_bytes, std::move(disk->refinements));
  const auto refinements = options.refinements;
  const dem::RasterCache cache = OpenCache(config);
  options.cache_problem = [folder = cache.folder] { return folder ? folder->problem() : std::string(); };
  std::unique_ptr<server::Reloader> reloader;  // once there are datasets to watch
  options.on_source_changed = config.watch ? std::function<void()>([&reloader] { reloader->Look(); }) : nullptr;
  options.on_signal[SIGHUP] = [&reloader] {
    NotifyReloading();
    reloader->Reload();
  };
  std::stop_source stop_opening;
  options.on_stop = [&watchdog, &stop_opening, limit = config.drain_delay + config.drain_timeout + kStopTime] {
    watchdog.Begin(limit);
    stop_opening.request_stop();
    NotifyStopping();
  };
  const auto level = std::make_shared<std::atomic<config::LogLevel>>(config.log_level);  // the configured one
  options.on_signal[SIGUSR1] = [] { SetLogLevel(config::LogLevel::kDebug); };
  options.on_signal[SIGUSR2] = [level] { SetLogLevel(*level); };
  // Listens before sources are opened, which may take long; requests wait meanwhile.
  auto started = server::Server::Start(nullptr, options);
  if (!started) return FailToStart(started.error());
  const std::unique_ptr<server::Server> server = *std::move(started);
  NotifyOpening();

  std::vector<tiler::Dataset> datasets;
  const bool are_open = OpenDatasets(config, cache, stop_opening.get_token(), datasets);
  if (stop_opening.stop_requested()) return server->Wait() ? kExitOk : kExitFailure;
  if (!are_open) return kExitFailure;
  if (cache.folder) cache.folder->Trim();  // not before: what is wanted now stays
  baked->Use(datasets);
  std::atomic<std::size_t> count = datasets.size();
  const auto catalog_of = [refinements](const std::vector<tiler::Dataset>& served) {
    return server::MakeCatalog(std::make_shared<const tiler::TilePipeline>(served, refinements));
  };
  const auto served_text = [&] {
    const std::size_t datasets_served = count;
    return fmt::format("{} dataset{} at {}", datasets_served, datasets_served == 1 ? "" : "s", server->url());
  };
  config::ConfigWatch watch(arguments.config_path, [&arguments, config, is_read_once]() -> config::ConfigResult {
    if (is_read_once) return config;
    if (IsPipe(arguments.config_path)) {
      return tl::unexpected(std::vector<config::ConfigError>{{"", "has become a pipe or device; make it a file"}});
    }
    std::vector<config::ConfigError> wrong;
    config::Config loaded = MakeConfig(arguments, wrong);
    if (!wrong.empty()) return tl::unexpected(std::move(wrong));
    return loaded;
  });
  server::Reloader::Hooks hooks;
  hooks.load = [&watch] { return watch.Load(); };
  hooks.may_have_changed = [&watch] { return watch.MayHaveChanged(); };
  hooks.open = [cache](const config::DatasetConfig& wanted, std::stop_token stop) {
    return OpenDataset(wanted, cache, TERRACE_VERSION, {}, std::move(stop));
  };
  hooks.publish = [&](const std::vector<tiler::Dataset>& served, const config::Config& now) {
    if (level->exchange(now.log_level) != now.log_level) SetLogLevel(now.log_level);
    refinements->SetCapacity(now.refinement_cache_bytes);
    if (const Result<void> replaced = server->Replace(catalog_of(served), now); !replaced) {
      spdlog::error("the new configuration cannot be served: {}", replaced.error().message);
    } else {
      count = served.size();
    }
    baked->Use(served);
    std::vector<std::uint64_t> generations;
    for (const tiler::Dataset& dataset : served) generations.push_back(dataset.cache_generation());
    refinements->Retain(generations);
  };
  hooks.reloaded = [&] {
    server->ReopenAccessLog();
    NotifyReady(served_text());
  };
  hooks.report = [&](const std::map<std::string, std::string>& problems) { server->SetProblems(problems); };
  reloader = std::make_unique<server::Reloader>(config, datasets, std::move(hooks));
  if (const Result<void> served = server->Replace(catalog_of(datasets), config); !served) {
    return FailToStart(served.error());
  }
  datasets.clear();  // replaced files must not stay open
  reloader->Start(config.watch);
  fmt::print("terrace: serving {}\n", served_text());
  std::fflush(stdout);
  NotifyReady(served_text());
  MaskSignals(SIG_UNBLOCK, kAnsweredSignals);
  const server::MemoryTrimmer trimmer;
  const bool drained = server->Wait();
  reloader->Stop();
  return drained ? kExitOk : kExitFailure;
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
      "URL on stdout when it is ready; the log goes to stderr. SIGTERM or SIGINT ends the server after open\n"
      "requests are answered; a second signal ends it at once.");
  command->add_option("DEM", arguments->dems,
                      "Rasters that GDAL can read, folders of them, or archives; each is one dataset");
  command->add_option("--config", arguments->config_file, "Configuration in JSON; docs/configuration.md describes it")
      ->type_name("FILE");
  command->add_flag("--print-config", arguments->print_config,
                    "Prints the configuration with all defaults and options as JSON, and ends");
  command->add_flag("--check-config", arguments->check_config,
                    "Checks whether the server could start, without opening rasters or listening, and ends");
  AddFlags(*command, config::ServerOptions(), "Server", arguments->server_flags);
  AddFlags(*command, config::DatasetOptions(), "Datasets of the DEMs on the command line", arguments->dataset_flags);
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
