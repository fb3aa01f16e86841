// How a configuration shares out the process's file descriptors.
#pragma once

#include "config/config.h"
#include "engine/core/result.h"
#include "server/descriptors.h"

namespace terrace::cli {

// Raises the limit on open files as far as it may. kUnavailable: the limit is too low. Before the server opens files
// of its own.
Result<server::DescriptorBudget> PlanDescriptors(const config::Config& config);

// In the log, where something gets less than the configuration says.
void WarnAboutFewDescriptors(const config::Config& config, const server::DescriptorBudget& budget);

}  // namespace terrace::cli
