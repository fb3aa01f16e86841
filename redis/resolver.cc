#include "redis/resolver.h"

#include <netdb.h>
#include <sys/socket.h>

#include <condition_variable>
#include <map>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>

namespace terrace::redis {
namespace {

using Clock = std::chrono::steady_clock;
using Addresses = std::vector<HostAddress>;

// `flags`: with AI_NUMERICHOST no name server is asked.
Result<Addresses> AskSystem(const std::string& host, std::uint16_t port, int flags) {
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  hints.ai_flags = flags;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host.c_str(), std::to_string(port).c_str(), &hints, &found);
  if (error != 0) {
    const bool is_unknown = error == EAI_NONAME || error == EAI_FAIL;
    return MakeError(is_unknown ? ErrorCode::kNotFound : ErrorCode::kUnavailable, "{}", ::gai_strerror(error));
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owned(found, ::freeaddrinfo);
  Addresses addresses;
  for (const addrinfo* one = found; one != nullptr; one = one->ai_next) {
    addresses.emplace_back(reinterpret_cast<const char*>(one->ai_addr), one->ai_addrlen);
  }
  return addresses;
}

}  // namespace

struct Resolver::Shared {
  struct Host {
    bool is_asked = false;  // a look-up is under way
    std::uint64_t answers = 0;
    Error why;  // of the last answer, if it failed
    bool failed = false;
    Addresses found;  // last
  };

  explicit Shared(LookUp l) : look_up(std::move(l)) {}

  const LookUp look_up;
  std::mutex mutex;
  std::condition_variable answered;
  std::map<std::pair<std::string, std::uint16_t>, Host> hosts;
};

Resolver::Resolver(LookUp look_up) : shared_(std::make_shared<Shared>(std::move(look_up))) {}

Resolver& Resolver::OfSystem() {
  // Never destroyed: threads may ask until the process has ended.
  static Resolver* const resolver =
      new Resolver([](const std::string& host, std::uint16_t port) { return AskSystem(host, port, 0); });
  return *resolver;
}

Result<std::vector<HostAddress>> Resolver::Resolve(const std::string& host, std::uint16_t port,
                                                   Clock::time_point deadline) {
  if (auto numbers = AskSystem(host, port, AI_NUMERICHOST)) return numbers;
  std::unique_lock lock(shared_->mutex);
  Shared::Host& of = shared_->hosts[{host, port}];  // stays where it is
  const std::uint64_t answers = of.answers;
  if (!of.is_asked) {
    const auto ask = [shared = shared_, host, port] {
      Result<Addresses> found = shared->look_up(host, port);
      const std::lock_guard done(shared->mutex);
      Shared::Host& asked = shared->hosts[{host, port}];
      asked.is_asked = false;
      ++asked.answers;
      asked.failed = !found || found->empty();
      if (!asked.failed) {
        asked.found = *std::move(found);
      } else {
        asked.why = found ? Error{ErrorCode::kNotFound, "the host has no address"} : found.error();
        if (asked.why.code == ErrorCode::kNotFound) asked.found.clear();
      }
      shared->answered.notify_all();
    };
    try {
      std::thread(ask).detach();
      of.is_asked = true;
    } catch (const std::system_error&) {
      if (of.found.empty())
        return MakeError(ErrorCode::kUnavailable, "the host is not known (no thread for its look-up)");
      return of.found;
    }
  }
  const Clock::time_point now = Clock::now();
  const Clock::time_point until = of.found.empty() ? deadline : now + (deadline - now) / 2;
  const bool is_answered = shared_->answered.wait_until(lock, until, [&] { return of.answers != answers; });
  if (!of.found.empty()) return of.found;
  if (!is_answered) {
    return MakeError(ErrorCode::kUnavailable,
                     "the host is not known in time; its name server does not answer, give an address instead");
  }
  return MakeError(ErrorCode::kUnavailable, "the host is not known ({}); correct the URL", of.why.message);
}

}  // namespace terrace::redis
