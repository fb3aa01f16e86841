// What systemd is told by a service of Type=notify. Without systemd nothing happens.
#pragma once

#include <string>

namespace terrace::cli {

// `status`: what `systemctl status` shows, one line.
void NotifyReady(const std::string& status);
void NotifyReloading();  // NotifyReady follows
void NotifyStopping();

}  // namespace terrace::cli
