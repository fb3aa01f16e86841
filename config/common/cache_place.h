// The default folder of the statistics cache.
#pragma once

#include <string>

namespace terrace::config {

// Derived from the environment: CACHE_DIRECTORY, which systemd sets (the first of several folders), else
// XDG_CACHE_HOME/terrace, else HOME/.cache/terrace. Ignores relative paths, as the XDG specification requires. Empty:
// there is none.
std::string CacheDirFromEnvironment();

}  // namespace terrace::config
