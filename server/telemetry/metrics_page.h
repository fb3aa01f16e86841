// Makes the text of /metrics on a separate thread: io threads must not be blocked by it, and monitoring must not wait
// for workers. Requests at about the same time share one text.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "server/asio/asio.h"

namespace terrace::server {

class MetricsPage {
 public:
  using Text = std::shared_ptr<const std::string>;

  // Calls `write` on that thread, one call at a time. A text is reused for `age`.
  MetricsPage(std::function<std::string()> write, std::chrono::milliseconds age);

  // May be called on any thread, until Stop.
  asio::awaitable<Text> Get();

  // Waits until all calls of Get have their results. The executors of the calls must still exist, but need not run.
  void Stop();

 private:
  static asio::awaitable<Text> Make(MetricsPage* self);

  const std::function<std::string()> write_;
  const std::chrono::milliseconds age_;
  // Used only by that thread.
  Text text_;
  std::chrono::steady_clock::time_point made_;
  asio::thread_pool thread_{1};
};

}  // namespace terrace::server
