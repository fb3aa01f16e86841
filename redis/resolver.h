// The addresses of a host, looked up within a deadline.
//
// The system's resolver has time-outs of its own, of half a minute and more. So it is asked by a thread of which the
// caller waits only for so long, and the addresses that it found last stand in for those that it does not find in time.
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

// Thread-safe. A look-up that is not over when the object is destroyed goes on by itself.
class Resolver {
 public:
  // kNotFound: there is no such host. Other errors: nobody knows at the moment.
  using LookUp = std::function<Result<std::vector<HostAddress>>(const std::string& host, std::uint16_t port)>;

  explicit Resolver(LookUp look_up);

  // That of the system. Shared by the process, so that all know what one has found.
  static Resolver& OfSystem();

  // Numbers are converted at once. If addresses were found before, waits for newer ones at most half of the time. At
  // most one look-up of a host is under way. kUnavailable: the message says why.
  Result<std::vector<HostAddress>> Resolve(const std::string& host, std::uint16_t port,
                                           std::chrono::steady_clock::time_point deadline);

 private:
  struct Shared;
  const std::shared_ptr<Shared> shared_;
};

}  // namespace terrace::redis
