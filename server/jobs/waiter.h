// Lets a coroutine wait for a result of another thread.
#pragma once

#include <boost/asio/steady_timer.hpp>
#include <memory>

#include "server/asio.h"

namespace terrace::server {

// A timer that expires at the waiter's deadline and is cancelled by Wake. It belongs to the thread of its executor.
using WaiterPtr = std::shared_ptr<asio::steady_timer>;

// Ends the wait, on the waiter's own thread. The coroutine suspends in its wait before its thread runs anything else,
// so the cancellation always meets a wait. From any thread; never throws. Null: nothing to do.
void Wake(WaiterPtr waiter);

}  // namespace terrace::server
