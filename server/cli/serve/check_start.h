// Checks before a server starts.
#pragma once

#include "config/config.h"
#include "engine/core/result.h"
#include "server/descriptors.h"

namespace terrace::cli {

// Reports on stderr everything that would keep the server from starting, as far as it can be known before sources are
// opened. Returns the exit code; kExitOk if there is nothing. Puts the source policy in force. `served`: `config` as
// passed to the server. `descriptors`: its descriptor budget. `tries_address`: checks that the address is free.
int CheckStart(const config::Config& config, const config::Config& served,
               const Result<server::DescriptorBudget>& descriptors, bool tries_address);

}  // namespace terrace::cli
