// Where statistics of sources are kept unless the configuration says otherwise.
#pragma once

#include <string>

namespace terrace::config {

// By the environment: CACHE_DIRECTORY, which systemd sets (the first of several folders), else XDG_CACHE_HOME/terrace,
// else HOME/.cache/terrace. Relative paths do not count, as the XDG specification wants. Empty: there is no such place.
std::string DefaultCachePlace();

}  // namespace terrace::config
