// How many connections the process's limit on open files leaves room for.
#pragma once

#include <cstddef>

namespace terrace::server {

// Raises the limit as far as it may, and returns `wanted`, or fewer where files have to stay readable beside the
// connections: half of what is free, or all but `for_files`.
std::size_t RoomForConnections(std::size_t wanted, std::size_t for_files);

}  // namespace terrace::server
