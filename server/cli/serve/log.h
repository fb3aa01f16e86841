// The process's log: spdlog on stderr, so that stdout belongs to results.
#pragma once

#include "config/config.h"

namespace terrace::cli {

// From any thread, while others log. Says so.
void SetLogLevel(config::LogLevel level);

void SetUpLog(config::LogLevel level, config::LogFormat format);

}  // namespace terrace::cli
