// Lets a coroutine wait for what another thread brings.
#pragma once

#include <boost/asio/steady_timer.hpp>
#include <memory>

#include "server/asio.h"

namespace terrace::server {

// Waits until its time, which is the waiter's deadline, and is cancelled by Wake. A timer belongs to the thread of its
// executor.
using WaiterPtr = std::shared_ptr<asio::steady_timer>;

// Ends the wait, on the waiter's own thread. The coroutine suspends in its wait before its thread runs anything else,
// so the cancellation always meets a wait. From any thread; never throws. Null: nothing to do.
void Wake(WaiterPtr waiter);

}  // namespace terrace::server
