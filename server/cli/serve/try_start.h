// What is tried before a server starts.
#pragma once

#include "config/config.h"
#include "engine/core/result.h"
#include "server/descriptors.h"

namespace terrace::cli {

// Tells, on stderr, of everything that keeps the server from starting and can be known before sources are opened; the
// exit code, kExitOk if there is nothing. The policy of sources is in force then. `served`: `config` as the server gets
// it; `descriptors`: made of it. `tries_address`: whether the address is to be free.
int TryStart(const config::Config& config, const config::Config& served,
             const Result<server::DescriptorBudget>& descriptors, bool tries_address);

}  // namespace terrace::cli
