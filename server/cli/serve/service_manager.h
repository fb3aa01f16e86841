// Socket activation and notification for the service manager (systemd, Type=notify). Does nothing without a service
// manager.
#pragma once

#include <optional>
#include <string>

#include "engine/core/result.h"

namespace terrace::cli {

// Returns the TCP socket that was passed to this process (socket activation, sd_listen_fds(3)); nothing if there is
// none. kInvalidArgument: the socket is not a listening TCP socket, or there are several. Call once, before threads are
// started, because it changes the environment.
Result<std::optional<int>> TakeListenSocket();

// `status`: the line that `systemctl status` shows.
void NotifyOpening();  // NotifyReady follows
void NotifyReady(const std::string& status);
void NotifyReloading();  // NotifyReady follows
void NotifyStopping();

}  // namespace terrace::cli
