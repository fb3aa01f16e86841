// The process's log: spdlog on stderr. Results go to stdout.
#pragma once

#include "config/config.h"

namespace terrace::cli {

// Thread-safe. Logs the change.
void SetLogLevel(config::LogLevel level);

void SetUpLog(config::LogLevel level, config::LogFormat format);

}  // namespace terrace::cli
