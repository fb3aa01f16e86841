#include "server/cli/service_manager.h"

#include <fmt/format.h>
#include <systemd/sd-daemon.h>

#include <chrono>

namespace terrace::cli {

void NotifyReady(const std::string& status) { ::sd_notify(0, fmt::format("READY=1\nSTATUS={}", status).c_str()); }

void NotifyReloading() {
  // systemd compares with CLOCK_MONOTONIC, which is what steady_clock is on Linux.
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
  ::sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}", us).c_str());
}

void NotifyStopping() { ::sd_notify(0, "STOPPING=1\nSTATUS=answering what has begun"); }

}  // namespace terrace::cli
