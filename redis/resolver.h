// The addresses of a host, looked up within a deadline.
//
// The system's resolver has time-outs of its own, of half a minute and more. Therefore a separate thread calls it.
// The caller waits until its deadline, or, if an earlier look-up found addresses, half of that time, and then gets
// those.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::redis {

using HostAddress = std::string;  // the bytes of a sockaddr

// Thread-safe. A look-up that still runs when the object is destroyed continues in the background.
class Resolver {
 public:
  // kNotFound: there is no such host. Other errors: the look-up failed, and a later one may succeed.
  using LookUp = std::function<Result<std::vector<HostAddress>>(const std::string& host, std::uint16_t port)>;

  explicit Resolver(LookUp look_up);

  // The resolver of the system, shared by the process with the addresses that it has found.
  static Resolver& OfSystem();

  // Numeric addresses are converted at once. At most one look-up of a host is under way. kUnavailable: the message says
  // why.
  Result<std::vector<HostAddress>> Resolve(const std::string& host, std::uint16_t port,
                                           std::chrono::steady_clock::time_point deadline);

 private:
  struct Shared;
  const std::shared_ptr<Shared> shared_;
};

}  // namespace terrace::redis
