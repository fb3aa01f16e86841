// The one way into Boost.Asio: names, and proof that the build found the right Boost. Debian's default 1.74 sits in the
// system's include path and compiles silently where a target forgets Boost::headers, but lacks what sessions rely on.
//
// Two rules for coroutines, both from double destructions seen with g++ 12: no capturing lambda as a coroutine, and no
// braced aggregate as a temporary in an expression that holds a co_await. Parameters of coroutines are taken by value.
#pragma once

#include <boost/asio/awaitable.hpp>
#include <boost/version.hpp>

static_assert(BOOST_VERSION >= 108100, "terrace needs Boost 1.81 or newer; run tools/install_deps.sh");

namespace terrace::server {

namespace asio = boost::asio;

}  // namespace terrace::server
