// Detects that a client no longer waits for its answer.
#pragma once

#include "server/asio/asio.h"
#include "server/net/stream.h"

namespace terrace::server {

// Returns when the client has closed or reset the connection, at the earliest 100 ms after the call. A client that has
// closed only its sending direction still waits for its reply. A client that has closed the connection looks the same
// until it is sent bytes; therefore the first bytes of the reply are sent ahead (Stream::SendAhead). TLS clients end
// their sending only when they close, so with TLS the end of sending counts as closing. Cancel it when the result is no
// longer needed; it then returns or throws. Reads nothing.
asio::awaitable<void> ClientLeft(Stream& stream);

}  // namespace terrace::server
