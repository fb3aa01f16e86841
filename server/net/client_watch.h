// Whether a client still waits for its answer.
#pragma once

#include "server/asio.h"
#include "server/net/stream.h"

namespace terrace::server {

// Returns when the client has closed or reset the connection, a while after the call at the earliest. A client that has
// only ended its own sending still waits for its reply; one that has closed altogether looks the same until bytes are
// sent to it, so that it is sent the first bytes of its reply (Stream::SendAhead). Over TLS the end of sending counts
// as the end: there it is sent on closing only. To be cancelled by whoever does not need to know any more; reads
// nothing.
asio::awaitable<void> ClientLeft(Stream& stream);

}  // namespace terrace::server
