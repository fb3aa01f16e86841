// The text of /metrics, made on a thread of its own: threads that serve must not wait for it, and whoever watches the
// server must not wait for workers. Scrapers that ask at about the same time share one text.
#pragma once

#include <boost/asio/thread_pool.hpp>
#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "server/asio.h"

namespace terrace::server {

class MetricsPage {
 public:
  using Text = std::shared_ptr<const std::string>;

  // `write` is called on that thread, one call at a time; a text serves for `age`.
  MetricsPage(std::function<std::string()> write, std::chrono::milliseconds age);

  // From any thread, until Stop.
  asio::awaitable<Text> Get();

  // Waits until whoever asked has been answered. The threads that asked may have stopped by then, but not be gone.
  void Stop();

 private:
  static asio::awaitable<Text> Make(MetricsPage* self);

  const std::function<std::string()> write_;
  const std::chrono::milliseconds age_;
  // Of that thread alone.
  Text text_;
  std::chrono::steady_clock::time_point made_;
  asio::thread_pool thread_{1};
};

}  // namespace terrace::server
