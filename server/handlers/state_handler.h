// GET /livez, /readyz and /metrics: for operators of the server.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "server/api/call.h"
#include "server/asio.h"
#include "server/http/application.h"

namespace terrace::server {

// The key of the statistics cache's folder among the problems. No dataset has such a name.
inline constexpr const char* kCacheTrouble = "/cache_dir";

// The current state of the process. Thread-safe.
class ProcessState {
 public:
  virtual ~ProcessState() = default;
  virtual bool draining() const = 0;
  virtual bool opening() const = 0;  // the first catalog has not been opened yet
  // Problems by dataset; "" is the configuration, kCacheTrouble the cache folder.
  virtual std::map<std::string, std::string> troubles() const = 0;
  virtual asio::awaitable<std::shared_ptr<const std::string>> MetricsText() const = 0;
};

class StateHandler {
 public:
  // `state` must outlive this.
  explicit StateHandler(const ProcessState& state) : state_(state) {}

  Response Live(const Call& call) const;
  Response Ready(const Call& call) const;
  Answer Metrics(const Call& call) const;

 private:
  asio::awaitable<Response> WriteMetrics() const;

  const ProcessState& state_;
};

}  // namespace terrace::server
