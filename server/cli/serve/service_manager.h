// What the service manager (systemd) passes to a service and is told by one of Type=notify. Without one nothing
// happens.
#pragma once

#include <optional>
#include <string>

#include "engine/core/result.h"

namespace terrace::cli {

// The TCP socket that was passed to this process (socket activation, sd_listen_fds(3)); nothing where there is none.
// kInvalidArgument: it is none to serve HTTP on, or there are several. Once, before there are threads: it changes the
// environment.
Result<std::optional<int>> TakeListenSocket();

// `status`: what `systemctl status` shows, one line.
void NotifyOpening();  // NotifyReady follows
void NotifyReady(const std::string& status);
void NotifyReloading();  // NotifyReady follows
void NotifyStopping();

}  // namespace terrace::cli
