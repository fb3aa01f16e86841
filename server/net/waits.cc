#include "server/net/waits.h"

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <utility>
#include <variant>

#include "server/net/client_watch.h"

namespace terrace::server {

using asio::experimental::awaitable_operators::operator||;

asio::awaitable<bool> SleepWhileConnected(Stream& stream, std::chrono::milliseconds time) {
  stream.ExpiresNever();
  asio::steady_timer timer(stream.socket().get_executor(), time);
  const std::variant<std::monostate, std::monostate> first =
      co_await (timer.async_wait(asio::use_awaitable) || ClientLeft(stream));
  co_return first.index() == 0;
}

asio::awaitable<std::optional<TransferBudget::Hold>> HoldWhileConnected(Stream& stream, TransferBudget& transfers,
                                                                        TransferBudget::Ask ask,
                                                                        TransferBudget::Clock::time_point deadline) {
  stream.ExpiresNever();
  std::variant<std::optional<TransferBudget::Hold>, std::monostate> first =
      co_await (transfers.HoldWhenRoom(std::move(ask), deadline) || ClientLeft(stream));
  if (first.index() == 1) co_return std::nullopt;
  co_return std::move(std::get<0>(first));
}

}  // namespace terrace::server
