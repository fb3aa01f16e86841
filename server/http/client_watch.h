// Whether a client still waits for its answer.
#pragma once

#include "server/asio.h"
#include "server/http/stream.h"

namespace terrace::server {

// Returns when the client has closed or reset the connection. A client that closes only its own direction counts as
// gone as well, once its request takes a while: browsers abandon requests that way. To be cancelled by whoever does not
// need to know any more; reads nothing.
asio::awaitable<void> ClientLeft(Stream& stream);

}  // namespace terrace::server
