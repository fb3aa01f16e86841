#include "server/http/descriptors.h"

#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <iterator>

namespace terrace::server {

std::size_t RoomForConnections(std::size_t wanted, std::size_t for_files) {
  rlimit limit{};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) return wanted;
  limit.rlim_cur = limit.rlim_max;
  ::setrlimit(RLIMIT_NOFILE, &limit);  // raising to the hard limit needs no privilege
  std::error_code error;
  const std::filesystem::directory_iterator open("/proc/self/fd", error);
  const auto in_use = error ? 32 : static_cast<std::size_t>(std::distance(begin(open), end(open)));
  const std::size_t free = limit.rlim_cur > in_use ? limit.rlim_cur - in_use : 0;
  const std::size_t room = std::max<std::size_t>(free - std::min(for_files, free / 2), 1);
  if (room < wanted) {
    spdlog::warn("at most {} connections instead of {}: the limit on open files is {}; raise it (ulimit -n)", room,
                 wanted, limit.rlim_cur);
  }
  return std::min(wanted, room);
}

}  // namespace terrace::server
