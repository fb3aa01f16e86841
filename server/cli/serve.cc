// terrace serve: datasets from a config file and from the command line, over HTTP.
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <xxhash.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "config/config.h"
#include "config/config_watch.h"
#include "config/options.h"
#include "config/parse.h"
#include "config/working_directory.h"
#include "engine/dem/gdal/gdal_settings.h"
#include "server/cli/command.h"
#include "server/cli/descriptor_plan.h"
#include "server/cli/fail.h"
#include "server/cli/log.h"
#include "server/cli/open_layers.h"
#include "server/cli/open_source.h"
#include "server/cli/option_flags.h"
#include "server/cli/progress.h"
#include "server/cli/service_manager.h"
#include "server/cli/stop_limit.h"
#include "server/cli/try_start.h"
#include "server/memory_trimmer.h"
#include "server/reload/reloader.h"
#include "server/server.h"
#include "server/store/disk_cache.h"
#include "server/tiles/pipeline_catalog.h"
#include "tiler/encoder_version.h"
#include "tiler/tile_pipeline.h"

namespace terrace::cli {
namespace {

struct ServeArguments {
  std::filesystem::path directory;  // the working directory at the start; empty: it cannot be named
  std::vector<std::string> dems;
  std::string config_file, config_path;  // as it was given, and in full
  bool print_config = false, check_config = false;
  std::map<std::string, std::string> server_flags, dataset_flags;  // by option key
};

int Report(const std::vector<config::ConfigError>& errors, const std::string& file) {
  std::fprintf(stderr, "terrace: %zu %s in the configuration%s%s:\n", errors.size(),
               errors.size() == 1 ? "thing is wrong" : "things are wrong", file.empty() ? "" : " ", file.c_str());
  for (const config::ConfigError& error : errors) {
    std::fprintf(stderr, "  %s%s%s\n", error.path.c_str(), error.path.empty() ? "" : ": ", error.message.c_str());
  }
  return kExitUsage;
}

// A folder keeps what looks like an extension, and a trailing slash changes nothing.
std::string StemOf(const std::string& dem) {
  std::error_code ignored;
  const std::filesystem::path path = std::filesystem::path(dem).lexically_normal();
  if (!std::filesystem::is_directory(path, ignored)) return path.stem().string();
  return path.has_filename() ? path.filename().string() : path.parent_path().filename().string();
}

// Something that can be read once, or without end.
bool IsPipe(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::is_other(path, ignored);
}

// The file's options, then the flags, then a dataset per DEM of the command line. Everything wrong is collected.
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
  if (arguments.dems.empty() && !arguments.dataset_flags.empty()) {
    errors.push_back(
        {"", "options of a dataset need a DEM on the command line; in a config file they stand in its dataset"});
  }
  if (arguments.dems.size() > 1 && arguments.dataset_flags.contains("name")) {
    errors.push_back({"--name", "names one dataset; give one DEM, or a config file with a name for each"});
  }
  config::DatasetConfig flags;  // checked once, however many DEMs they apply to
  for (const auto& [key, text] : arguments.dataset_flags) {
    config::SetDatasetOption(key, text, arguments.directory, flags, errors);
  }
  for (const std::string& written : arguments.dems) {
    if (written.empty()) {
      errors.push_back({"", "a DEM on the command line has an empty name"});
      continue;
    }
    const std::string dem = config::FromWorkingDirectory(arguments.directory, written);
    if (std::filesystem::path(dem).is_relative()) {
      errors.push_back({written, config::kNoWorkingDirectory});
      continue;
    }
    config::DatasetConfig& dataset = config.datasets.emplace_back(flags);
    if (dataset.name.empty()) dataset.name = config::SanitizeDatasetName(StemOf(dem));
    Result<config::SourceConfig> source = config::SourceAt(dem);
    if (source)
      dataset.sources = {*std::move(source)};
    else
      errors.push_back({written, source.error().message});
  }
  const std::vector<config::ConfigError> duplicates = config::FindDuplicateNames(config.datasets);
  if (errors.empty()) errors = duplicates;
  if (errors.empty() && config.datasets.empty() && !arguments.print_config) {
    errors.push_back(
        {"", arguments.config_file.empty()
                 ? "there is nothing to serve; name a DEM ('terrace serve dem.tif') or a config file (--config)"
                 : "there is nothing to serve; it needs an entry in \"datasets\""});
  }
  return config;
}

// Changes when the source or an option that changes bytes does. The file's identity is in the source's fingerprint.
std::uint64_t GenerationOf(const config::DatasetConfig& dataset, const dem::DemSource& source,
                           const std::string& layers) {
  const std::string text = fmt::format(TERRACE_VERSION " {} {} {} {} {} {} {}", source.fingerprint(),
                                       dataset.error_fraction, static_cast<int>(dataset.criterion), dataset.compact,
                                       dataset.draco_speed, dataset.draco_normal_bits, layers);
  return XXH3_64bits(text.data(), text.size());
}

tin::Criterion CriterionOf(config::Criterion criterion) {
  return criterion == config::Criterion::kDataDependent ? tin::Criterion::kDataDependent : tin::Criterion::kDelaunay;
}

proto::GlbOptions GlbOptionsOf(const config::DatasetConfig& dataset) {
  proto::GlbOptions options;
  options.generator = "terrace " TERRACE_VERSION;
  options.draco = {dataset.draco_speed, dataset.draco_normal_bits};
  switch (dataset.glb_compression) {
    case config::GlbCompression::kDraco:
      options.compression = proto::GlbCompression::kDraco;
      break;
    case config::GlbCompression::kNone:
      options.compression = proto::GlbCompression::kNone;
      break;
    case config::GlbCompression::kQuantized:
      options.compression = proto::GlbCompression::kQuantized;
      break;
    case config::GlbCompression::kMeshopt:
      options.compression = proto::GlbCompression::kMeshopt;
      break;
  }
  return options;
}

Result<tiler::Dataset> OpenDataset(const config::DatasetConfig& wanted, const std::string& cache_dir,
                                   const std::function<void(double)>& progress, std::stop_token stop) {
  auto source = OpenSource(wanted, cache_dir, progress, std::move(stop));
  if (!source) return tl::unexpected(source.error());
  tiler::Dataset dataset;
  dataset.name = wanted.name;
  dataset.attribution = wanted.attribution;
  dataset.error_fraction = wanted.error_fraction;
  dataset.rules = {CriterionOf(wanted.criterion), wanted.compact};
  dataset.glb = GlbOptionsOf(wanted);
  dataset.source = *std::move(source);
  if (const Result<void> layers = OpenLayers(wanted, dataset); !layers) return tl::unexpected(layers.error());
  dataset.generation = GenerationOf(wanted, *dataset.source, LayersFingerprint(dataset));
  return dataset;
}

// Opens every source; false if one could not be, after all of them had their message, or if it was stopped.
bool OpenDatasets(const config::Config& config, const std::stop_token& stop, std::vector<tiler::Dataset>& datasets) {
  bool all_open = true;
  for (const config::DatasetConfig& wanted : config.datasets) {
    Progress progress((config.cache_dir.empty() ? "reading " : "preparing ") + NameOf(wanted.sources),
                      FileCount(wanted.sources));
    Result<tiler::Dataset> dataset = OpenDataset(wanted, config.cache_dir, progress.Callback(), stop);
    if (stop.stop_requested()) return false;
    if (!dataset) {
      std::fprintf(stderr, "terrace: dataset %s: %s\n", wanted.name.c_str(), dataset.error().message.c_str());
      all_open = false;
      continue;
    }
    spdlog::info("dataset {}: {}, levels 0 to {}", dataset->name, NameOf(wanted.sources), dataset->source->max_level());
    datasets.push_back(*std::move(dataset));
  }
  return all_open;
}

server::AccessLogForm AccessLogFormOf(config::AccessLog form) {
  switch (form) {
    case config::AccessLog::kCombined:
      return server::AccessLogForm::kCombined;
    case config::AccessLog::kJson:
      return server::AccessLogForm::kJson;
    case config::AccessLog::kOff:
      return server::AccessLogForm::kOff;
    case config::AccessLog::kLog:
      break;
  }
  return server::AccessLogForm::kLog;
}

server::EdgeOptions EdgeOf(const config::Config& config) {
  server::EdgeOptions edge;
  edge.max_connections = config.max_connections;
  edge.max_connections_per_client = config.max_connections_per_client;
  edge.requests_per_second = config.requests_per_second;
  edge.request_burst = config.request_burst;
  edge.transfer_bytes = config.transfer_bytes;
  for (const config::TokenConfig& token : config.tokens) {
    edge.tokens.push_back({token.name, "", token.sha256, token.datasets, token.requests_per_second});
  }
  for (const config::DatasetConfig& dataset : config.datasets) {
    if (dataset.is_public) edge.public_datasets.push_back(dataset.name);
  }
  edge.cors_origins = config.cors_origins;
  edge.trusted_proxies = config.trusted_proxies;
  if (config.forwarded_header == config::ForwardedHeader::kForwarded) {
    edge.forwarded_header = server::ForwardedHeader::kForwarded;
  }
  edge.tls_certificate = config.tls.certificate;
  edge.tls_key = config.tls.key;
  return edge;
}

server::ServerOptions OptionsOf(const config::Config& config) {
  server::ServerOptions options;
  options.host = config.listen.host;
  options.port = config.listen.port;
  options.io_threads = config.io_threads;
  options.worker_threads = config.worker_threads;
  options.queue_length = config.queue_length;
  options.cache_bytes = config.cache_bytes;
  options.max_locations = config.max_locations;
  options.edge = EdgeOf(config);
  options.cache_control = config.cache_control;
  options.header_timeout = config.header_timeout;
  options.idle_timeout = config.idle_timeout;
  options.write_timeout = config.write_timeout;
  options.min_read_rate = config.min_read_rate;
  options.request_deadline = config.request_deadline;
  options.drain_timeout = config.drain_timeout;
  options.stop_on_signals = true;
  options.access_log = AccessLogFormOf(config.access_log);
  options.access_log_file = config.access_log_file;
  if (config.viewer.enabled) {
    options.viewer_dir = config.viewer.directory;
    if (options.viewer_dir.empty()) {
      // Installed beside the binary, else where it was built.
      std::error_code ignored;
      const std::filesystem::path binary = std::filesystem::read_symlink("/proc/self/exe", ignored);
      options.viewer_dir = binary.parent_path().parent_path() / "share/terrace/viewer";
      if (!std::filesystem::exists(options.viewer_dir, ignored)) options.viewer_dir = TERRACE_VIEWER_DIR;
    }
  }
  return options;
}

// What stopping may take beyond the drain timeout.
constexpr std::chrono::seconds kStopTime{1};

// Signals that mean something to the running server, besides those that end it.
const std::vector<int> kAnsweredSignals = {SIGUSR1, SIGUSR2, SIGHUP};

// `how`: SIG_BLOCK or SIG_UNBLOCK. For this thread and those that it begins.
void MaskSignals(int how, const std::vector<int>& signals) {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : signals) ::sigaddset(&set, signal);
  ::pthread_sigmask(how, &set, nullptr);
}

// Null where there is to be none.
Result<std::shared_ptr<server::DiskCache>> OpenDiskCache(const config::DiskCacheConfig& config,
                                                         std::size_t open_files) {
  if (config.directory.empty()) return nullptr;
  server::DiskCacheOptions options;
  options.directory = config.directory;
  options.tile_bytes = config.tile_bytes;
  options.refinement_bytes = config.refinement_bytes;
  options.open_files = open_files;
  return server::DiskCache::Open(options);
}

int CheckConfig(const ServeArguments& arguments, const config::Config& config) {
  if (const int exit_code = TryStart(config, OptionsOf(config), PlanDescriptors(config), /*tries_address=*/false);
      exit_code != kExitOk)
    return exit_code;
  const std::size_t count = config.datasets.size();
  fmt::print(
      "terrace: the configuration{}{} is fine: {} dataset{}; rasters were not opened, 'terrace info' does that\n",
      arguments.config_file.empty() ? "" : " ", arguments.config_file, count, count == 1 ? "" : "s");
  return FinishOutput(kExitOk);
}

int Fail(const Error& error) {
  std::fprintf(stderr, "terrace: %s\n", error.message.c_str());
  return kExitFailure;
}

int Serve(const ServeArguments& arguments) {
  std::signal(SIGPIPE, SIG_IGN);  // whoever reads the log may go away; the server stays
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow fails to be written, as on a full disk
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
  if (!passed) return Fail(passed.error());
  // Until they are answered they would be the end, and who rotates logs does not ask how long sources take to open.
  MaskSignals(SIG_BLOCK, kAnsweredSignals);
  tiler::EncoderVersion();  // of the libraries there are, before GDAL or the system's resolver loads others
  server::ServerOptions options = OptionsOf(config);
  options.listen_socket = passed->value_or(-1);
  const bool tries_address = !passed->has_value();
  const Result<server::DescriptorBudget> budget = PlanDescriptors(config);
  if (const int exit_code = TryStart(config, options, budget, tries_address); exit_code != kExitOk) return exit_code;
  WarnAboutFewDescriptors(config, *budget);
  options.edge.max_connections = budget->connections;
  dem::SetGdalCache(config.gdal_cache_bytes);
  dem::SetOpenSources(budget->open_sources, budget->vrt_parts);

  StopLimit stop_limit;  // first, as it bounds how long the others take to end
  Result<std::shared_ptr<server::DiskCache>> disk = OpenDiskCache(config.disk_cache, budget->store_files);
  if (!disk) return Fail(disk.error());
  const auto refinements = std::make_shared<tiler::RefinementCache>(
      config.refinement_cache_bytes,
      *disk ? std::shared_ptr<tiler::RefinementStore>(*disk, (*disk)->refinements()) : nullptr);
  options.disk_cache = *std::move(disk);
  options.refinement_stats = [refinements] { return refinements->stats(); };
  std::unique_ptr<server::Reloader> reloader;  // once there is something to look after
  options.on_source_changed = config.watch ? std::function<void()>([&reloader] { reloader->Look(); }) : nullptr;
  options.on_signal[SIGHUP] = [&reloader] {
    NotifyReloading();
    reloader->Reload();
  };
  std::stop_source stop_opening;
  options.on_stop = [&stop_limit, &stop_opening, limit = config.drain_timeout + kStopTime] {
    stop_limit.Begin(limit);
    stop_opening.request_stop();
    NotifyStopping();
  };
  const auto level = std::make_shared<std::atomic<config::LogLevel>>(config.log_level);  // the configured one
  options.on_signal[SIGUSR1] = [] { SetLogLevel(config::LogLevel::kDebug); };
  options.on_signal[SIGUSR2] = [level] { SetLogLevel(*level); };
  // Before sources are opened, which may take long: who asks meanwhile waits.
  auto started = server::Server::Start(nullptr, options);
  if (!started) return Fail(started.error());
  const std::unique_ptr<server::Server> server = *std::move(started);
  NotifyOpening();

  std::vector<tiler::Dataset> datasets;
  const bool are_open = OpenDatasets(config, stop_opening.get_token(), datasets);
  if (stop_opening.stop_requested()) return server->Wait() ? kExitOk : kExitFailure;
  if (!are_open) return kExitFailure;
  std::atomic<std::size_t> count = datasets.size();
  const auto catalog_of = [refinements](const std::vector<tiler::Dataset>& served, const config::Config& now) {
    return server::MakeCatalog(std::make_shared<const tiler::TilePipeline>(served, refinements), now.max_mesh_samples);
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
  hooks.open = [cache_dir = config.cache_dir](const config::DatasetConfig& wanted, std::stop_token stop) {
    return OpenDataset(wanted, cache_dir, {}, std::move(stop));
  };
  hooks.publish = [&](const std::vector<tiler::Dataset>& served, const config::Config& now) {
    if (level->exchange(now.log_level) != now.log_level) SetLogLevel(now.log_level);
    refinements->SetCapacity(now.refinement_cache_bytes);
    if (const Result<void> replaced = server->Replace(catalog_of(served, now), OptionsOf(now)); !replaced) {
      spdlog::error("the new configuration cannot be served: {}", replaced.error().message);
    } else {
      count = served.size();
    }
    std::vector<std::uint64_t> generations;
    for (const tiler::Dataset& dataset : served) generations.push_back(dataset.generation);
    refinements->Retain(generations);
  };
  hooks.reloaded = [&] {
    server->ReopenAccessLog();
    NotifyReady(served_text());
  };
  hooks.tell = [&](const std::map<std::string, std::string>& troubles) { server->SetTroubles(troubles); };
  reloader = std::make_unique<server::Reloader>(config, datasets, std::move(hooks));
  if (const Result<void> served = server->Replace(catalog_of(datasets, config), options); !served) {
    return Fail(served.error());
  }
  datasets.clear();  // what is replaced must not stay open
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
  CLI::App* command = app.add_subcommand("serve", "Serves DEMs as terrain tiles over HTTP, with a viewer at /");
  command->footer(
      "Examples:\n"
      "  terrace serve alps.tif andes.tif\n"
      "  terrace serve --config terrace.json --listen 0.0.0.0:8080\n\n"
      "Each DEM becomes a dataset named after its file; a folder of DEMs becomes one dataset. Flags override the "
      "config file. Prints one line with\n"
      "the URL when it is ready; logs go to stderr; SIGTERM and SIGINT end it after open requests are answered, a "
      "second one at once.");
  command->add_option("DEM", arguments->dems, "Rasters that GDAL can read, or folders of them, one dataset each");
  command->add_option("--config", arguments->config_file, "Configuration in JSON (config/config.schema.json)")
      ->type_name("FILE");
  command->add_flag("--print-config", arguments->print_config, "Prints the configuration in force as JSON and ends");
  command->add_flag("--check-config", arguments->check_config,
                    "Says whether the server could start, without opening rasters or listening, and ends");
  AddFlags(*command, config::ServerOptions(), "Server", arguments->server_flags);
  AddFlags(*command, config::DatasetOptions(), "Datasets of the command line", arguments->dataset_flags);
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
