#include "server/descriptors.h"

#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <string>
#include <system_error>

#include "server/store/record_db.h"

namespace terrace::server {
namespace {

// An event queue, a timer and a way to wake it up.
constexpr std::size_t kOfIoThread = 3;
// The listening socket, a spare to refuse connections, signals (two), PROJ's database, and one for short uses: the
// configuration, certificates, a message to systemd.
constexpr std::size_t kOfServer = 6;
// The socket, and a spare to refuse connections.
constexpr std::size_t kOfListener = 2;
constexpr std::size_t kMinConnections = 4;
// Datasets that the Reloader opens while the old ones are served.
constexpr std::size_t kOpeners = 2;
// A raster and its overviews, or a grid.
constexpr std::size_t kOfSource = 2;
// GDAL's own default.
constexpr std::size_t kMaxVrtParts = 100;

// The number of open parts of VRTs: each thread needs one, or two if a VRT consists of VRTs.
std::size_t VrtParts(std::size_t open_sources, std::size_t threads) {
  return std::max(std::min(open_sources, kMaxVrtParts), 2 * threads);
}

}  // namespace

Result<DescriptorBudget> SplitDescriptors(const DescriptorDemand& demand, std::size_t limit, std::size_t in_use) {
  const std::size_t threads = demand.worker_threads + kOpeners;  // threads that may use a source at the same time
  const std::size_t server = kOfServer + demand.single_archives + demand.shared_cache +
                             kOfIoThread * demand.io_threads + (demand.access_log_file ? 1 : 0) +
                             (demand.stores > 0 ? 1 : 0) +
                             (demand.has_admin_listener ? kAdminConnections + kOfListener : 0);
  const std::size_t of_stores = demand.stores * (RecordDb::kOtherDescriptors + RecordDb::kMinOpenFiles);
  const std::size_t least = in_use + server + of_stores + threads + kMinConnections;
  if (limit < least) {
    return MakeError(ErrorCode::kUnavailable,
                     "the limit on open files is {}, and this configuration takes {} at least: {} that are open "
                     "already, {} for the server itself, {} for the disk cache, {} for sources and {} for connections; "
                     "raise it (ulimit -n, LimitNOFILE= of systemd), or take fewer threads or no disk_cache",
                     limit, least, in_use, server, of_stores, threads, kMinConnections);
  }
  // A second descriptor per source, and the parts of VRTs that threads need.
  const std::size_t beside = (kOfSource - 1) * threads + (demand.has_vrts ? VrtParts(0, threads) : 0);
  const std::size_t left = limit - least - std::min(limit - least, beside);
  const std::size_t of_open_source = kOfSource + (demand.has_vrts ? 1 : 0);
  const std::size_t sources = of_open_source * demand.open_sources;
  const std::size_t files = demand.store_files - std::min(demand.store_files, RecordDb::kMinOpenFiles);
  const std::size_t connections = demand.connections - std::min(demand.connections, kMinConnections);
  const std::size_t wanted = sources + demand.stores * files + connections;
  const auto share_of = [&](std::size_t count) { return left < wanted ? count * left / wanted : count; };

  DescriptorBudget budget;
  budget.connections = std::min(demand.connections, kMinConnections) + share_of(connections);
  budget.store_files = RecordDb::kMinOpenFiles + share_of(files);
  budget.open_sources = share_of(sources) / of_open_source;
  budget.vrt_parts = VrtParts(budget.open_sources, threads);
  return budget;
}

std::size_t RaiseDescriptorLimit() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return 1024;  // POSIX names no reason for a failure
  const rlim_t before = limit.rlim_cur;
  limit.rlim_cur = limit.rlim_max;  // raising to the hard limit needs no privilege
  return ::setrlimit(RLIMIT_NOFILE, &limit) == 0 ? limit.rlim_cur : before;
}

std::size_t CountOpenDescriptors() {
  std::error_code error;
  const std::filesystem::directory_iterator open("/proc/self/fd", error);
  if (error) return 8;
  return static_cast<std::size_t>(std::distance(begin(open), end(open))) -
         1;  // without the descriptor of the folder itself
}

}  // namespace terrace::server
