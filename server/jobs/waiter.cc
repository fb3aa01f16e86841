#include "server/jobs/waiter.h"

#include <boost/asio/post.hpp>
#include <chrono>
#include <exception>
#include <thread>
#include <utility>

namespace terrace::server {

void Wake(WaiterPtr waiter) {
  if (!waiter) return;
  const auto executor = waiter->get_executor();
  // The waiter's thread may run at once: keep no reference here.
  const std::weak_ptr<asio::steady_timer> timer = std::exchange(waiter, nullptr);
  while (WaiterPtr here = timer.lock()) {
    try {
      return asio::post(executor, [waiter = std::move(here)] { waiter->cancel(); });
    } catch (const std::exception&) {  // no memory; the waiter then waits until its deadline
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
  }
}

}  // namespace terrace::server
