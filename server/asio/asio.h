// Includes Boost.Asio and checks its version. Debian's default Boost 1.74 is in the system's include path: a target
// that does not link Boost::headers would compile with it, but it lacks functions that sessions need. Two rules for
// coroutines, because g++ 12 destroys some objects twice: no capturing lambda as a coroutine, and no braced aggregate
// as a temporary in an expression with a co_await. Coroutines take parameters by value.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/version.hpp>

static_assert(BOOST_VERSION >= 108100, "terrace needs Boost 1.81 or newer; run tools/install_deps.sh");

namespace terrace::server {

namespace asio = boost::asio;

}  // namespace terrace::server
