// Divides the process's file descriptors according to the configuration.
#pragma once

#include "config/config.h"
#include "engine/core/result.h"
#include "server/descriptors.h"

namespace terrace::cli {

// The number of workers that the configuration gives: as many as the machine has processors, if it gives none.
unsigned WorkerThreads(const config::Config& config);

// Raises the limit on open files as far as permitted. kUnavailable: the limit is too low. Call before the server opens
// files.
Result<server::DescriptorBudget> PlanDescriptors(const config::Config& config);

// Logs a warning if some part gets fewer descriptors than configured.
void WarnAboutFewDescriptors(const config::Config& config, const server::DescriptorBudget& budget);

}  // namespace terrace::cli
