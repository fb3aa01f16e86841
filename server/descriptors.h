// The budget of file descriptors: divides the limit on open files between connections, sources and the disk cache.
//
// It is divided once, at the start, and each part keeps its share while the process runs: a dataset that is added by a
// reload, and its archive, use the share for sources.
#pragma once

#include <cstddef>

#include "engine/core/result.h"

namespace terrace::server {

// Connections of operators (admin_listen) at a time; they open few.
inline constexpr std::size_t kAdminConnections = 16;

// The descriptors that a configuration would use without a limit.
struct DescriptorDemand {
  unsigned io_threads = 1, worker_threads = 1;
  bool access_log_file = false;
  std::size_t stores = 0;       // of the disk cache
  std::size_t store_files = 0;  // record files of each that are open at a time
  std::size_t open_sources = 0;
  bool has_vrts = false;  // GDAL also keeps their parts open
  std::size_t connections = 1;
  std::size_t single_archives = 0;  // in one file, which stays open; files of units are sources
  std::size_t shared_cache = 0;     // connections to it
  bool has_admin_listener = false;
};

struct DescriptorBudget {
  std::size_t store_files = 0;   // of each store: RecordDbOptions::open_files
  std::size_t open_sources = 0;  // dem::SetOpenSources
  std::size_t vrt_parts = 0;     // dem::SetOpenSources
  std::size_t connections = 0;
};

// `limit`: of the process. `in_use`: descriptors that are open before the server opens any. Each part gets its minimum.
// Then the threads that read sources get the descriptors that overviews and parts of VRTs may need. The rest is divided
// in proportion to the demand. kUnavailable: the limit is below the sum of the minimums; the message lists them.
Result<DescriptorBudget> SplitDescriptors(const DescriptorDemand& demand, std::size_t limit, std::size_t in_use);

// The limit on open files, after raising it as far as this process may.
std::size_t RaiseDescriptorLimit();

std::size_t CountOpenDescriptors();

}  // namespace terrace::server
