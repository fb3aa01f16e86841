#include "server/cli/serve/descriptor_plan.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <system_error>
#include <thread>

#include "server/store/record_db.h"

namespace terrace::cli {
namespace {

// Besides those for look-ups: for writing, for a purge, and one that is being tried.
constexpr std::size_t kOtherSharedConnections = 3;

bool HasVrt(const config::DatasetConfig& dataset) {
  const auto is_vrt = [](const std::string& file) { return file.ends_with(".vrt") || file.ends_with(".VRT"); };
  return is_vrt(dataset.imagery.image) || is_vrt(dataset.water.mask) ||
         std::ranges::any_of(dataset.sources, [&](const config::SourceConfig& source) {
           return std::ranges::any_of(source.files, is_vrt);
         });
}

server::DescriptorDemand DemandOf(const config::Config& config) {
  server::DescriptorDemand demand;
  demand.io_threads = config.io_threads;
  demand.worker_threads = WorkerThreads(config);
  if (!config.shared_cache.url.empty()) demand.shared_cache = demand.worker_threads + kOtherSharedConnections;
  demand.access_log_file = !config.access_log_file.empty();
  demand.open_sources = config.max_open_sources;
  demand.has_vrts = std::ranges::any_of(config.datasets, HasVrt);
  demand.connections = config.max_connections;
  demand.has_admin_listener = config.admin_listen.has_value();
  for (const config::DatasetConfig& dataset : config.datasets) {
    std::error_code ignored;
    if (std::filesystem::is_regular_file(dataset.baked, ignored)) ++demand.single_archives;
  }
  if (config.disk_cache.directory.empty()) return demand;
  for (const std::size_t bytes : {config.disk_cache.tile_bytes, config.disk_cache.refinement_bytes}) {
    if (bytes == 0) continue;
    ++demand.stores;
    demand.store_files = std::max(demand.store_files, server::RecordDb::FilesOf(bytes));
  }
  return demand;
}

}  // namespace

unsigned WorkerThreads(const config::Config& config) {
  return config.worker_threads > 0 ? config.worker_threads : std::max(1u, std::thread::hardware_concurrency());
}

Result<server::DescriptorBudget> PlanDescriptors(const config::Config& config) {
  const std::size_t limit = server::RaiseDescriptorLimit();
  return server::SplitDescriptors(DemandOf(config), limit, server::CountOpenDescriptors());
}

void WarnAboutFewDescriptors(const config::Config& config, const server::DescriptorBudget& budget) {
  const server::DescriptorDemand demand = DemandOf(config);
  const bool is_enough = budget.connections == demand.connections && budget.open_sources == demand.open_sources &&
                         (demand.stores == 0 || budget.store_files >= demand.store_files);
  if (is_enough) return;
  spdlog::warn(
      "the limit on open files leaves room for {} of {} connections and {} of {} files of sources{}; raise it (ulimit "
      "-n, LimitNOFILE= of systemd)",
      budget.connections, demand.connections, budget.open_sources, demand.open_sources,
      demand.stores == 0
          ? ""
          : fmt::format(" and {} of {} files in each store of the disk cache", budget.store_files, demand.store_files));
}

}  // namespace terrace::cli
