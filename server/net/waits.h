// Waits that end when the client leaves. For coroutines that run on the stream's thread.
#pragma once

#include <chrono>
#include <optional>

#include "server/asio.h"
#include "server/net/stream.h"
#include "server/net/transfer_budget.h"

namespace terrace::server {

// Returns false if the client is gone.
asio::awaitable<bool> SleepWhileConnected(Stream& stream, std::chrono::milliseconds time);

// Returns nothing if the deadline has passed or the client is gone.
asio::awaitable<std::optional<TransferBudget::Hold>> HoldWhileConnected(Stream& stream, TransferBudget& transfers,
                                                                        TransferBudget::Ask ask,
                                                                        TransferBudget::Clock::time_point deadline);

}  // namespace terrace::server
