#include "server/cli/serve/service_manager.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <systemd/sd-daemon.h>

#include <chrono>

namespace terrace::cli {

Result<std::optional<int>> TakeListenSocket() {
  const int count = ::sd_listen_fds(/*unset_environment=*/1);
  if (count <= 0) return std::nullopt;  // below 0: the variables are for another process, or invalid
  if (count > 1) {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "systemd passed {} sockets, and terrace takes one: keep a single ListenStream= in the .socket unit; "
        "a port without an address serves IPv4 and IPv6",
        count);
  }
  const auto listens = [](int family) {
    return ::sd_is_socket(SD_LISTEN_FDS_START, family, SOCK_STREAM, /*listening=*/1) > 0;
  };
  if (!listens(AF_INET) && !listens(AF_INET6)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "the socket that was passed is no listening TCP socket: give the .socket unit "
                     "ListenStream=PORT or ADDRESS:PORT, and Accept=no");
  }
  return SD_LISTEN_FDS_START;
}

void NotifyOpening() { ::sd_notify(0, "STATUS=listening, opening the sources"); }

void NotifyReady(const std::string& status) { ::sd_notify(0, fmt::format("READY=1\nSTATUS={}", status).c_str()); }

void NotifyReloading() {
  // systemd expects CLOCK_MONOTONIC, which steady_clock is on Linux.
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(now).count();
  ::sd_notify(0, fmt::format("RELOADING=1\nMONOTONIC_USEC={}", us).c_str());
}

void NotifyStopping() { ::sd_notify(0, "STOPPING=1\nSTATUS=answering what has begun"); }

}  // namespace terrace::cli
