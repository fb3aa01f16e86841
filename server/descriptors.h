// One budget of file descriptors: what the limit on open files leaves for connections, sources and the disk cache.
//
// It is split once, at the start, and every part keeps to its share for as long as the process runs: a dataset that
// comes with a reload shares what there is for sources.
#pragma once

#include <cstddef>

#include "engine/core/result.h"
#include "engine/dem/gdal/gdal_settings.h"

namespace terrace::server {

// What a configuration would take if there were any number.
struct DescriptorDemand {
  unsigned io_threads = 1, worker_threads = 1;
  bool access_log_file = false;
  std::size_t stores = 0;       // of the disk cache
  std::size_t store_files = 0;  // record files of each that are open at a time
  std::size_t open_sources = 0;
  bool has_vrts = false;  // whose parts GDAL keeps open beside
  std::size_t connections = 1;
};

struct DescriptorBudget {
  std::size_t store_files = 0;   // of each store: RecordDbOptions::open_files
  std::size_t open_sources = 0;  // dem::SetOpenSources
  std::size_t vrt_parts = 0;     // likewise
  std::size_t connections = 0;
};

// `limit`: of the process. `in_use`: descriptors that are open before the server opens any. Everybody gets his least;
// then the threads that use sources get what they may need for overviews and parts of VRTs; what is left is shared out
// in proportion to what is wanted. kUnavailable: not even the least is there; the message says what it is made of.
Result<DescriptorBudget> SplitDescriptors(const DescriptorDemand& demand, std::size_t limit, std::size_t in_use);

// The limit on open files, after raising it as far as this process may.
std::size_t RaiseDescriptorLimit();

std::size_t CountOpenDescriptors();

}  // namespace terrace::server
