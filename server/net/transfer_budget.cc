#include "server/net/transfer_budget.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <exception>

namespace terrace::server {
namespace {

// Who waits looks so often whether others have had their time, and whether it was overlooked when there was no memory
// to wake it.
constexpr std::chrono::milliseconds kLook{250};

}  // namespace

// In waiters_ while it lives, which is in a frame of HoldWhenRoom.
class TransferBudget::Waiter {
 public:
  Waiter(TransferBudget& owner, const Ask& asked, const asio::any_io_executor& executor)
      : ask(asked), timer(std::make_shared<asio::steady_timer>(executor)), budget(owner) {
    const std::lock_guard lock(budget.mutex_);
    budget.waiters_.push_back(this);
  }
  Waiter(const Waiter&) = delete;
  Waiter& operator=(const Waiter&) = delete;
  ~Waiter() {
    const std::lock_guard lock(budget.mutex_);
    std::erase(budget.waiters_, this);
    budget.WakeNext(PoolOf(ask.kind));
  }

  const Ask& ask;
  const std::shared_ptr<asio::steady_timer> timer;
  TransferBudget& budget;
};

std::optional<TransferBudget::Hold> TransferBudget::TryHold(const Ask& ask, Clock::time_point now) {
  if (ask.bytes <= kFreeBytes) return Hold();
  const std::lock_guard lock(mutex_);
  return Take(ask, now, nullptr);
}

asio::awaitable<std::optional<TransferBudget::Hold>> TransferBudget::HoldWhenRoom(Ask ask, Clock::time_point deadline) {
  std::optional<Hold> hold;
  if (ask.bytes <= kFreeBytes) {
    hold.emplace();
    co_return hold;
  }
  const auto executor = co_await asio::this_coro::executor;
  const Waiter waiter(*this, ask, executor);
  for (;;) {
    const auto now = Clock::now();
    Victims victims;
    {
      const std::lock_guard lock(mutex_);
      hold = Take(ask, now, &waiter);
      if (!hold && now < deadline) victims = ChooseVictims(ask, now);
      if (!hold && now >= deadline) ++refused_;
    }
    if (hold || now >= deadline) co_return hold;
    for (const auto& connection : victims.cut) connection->Abort();
    for (const auto& connection : victims.displaced) connection->Displace();
    waiter.timer->expires_at(std::min(deadline, now + kLook));
    boost::system::error_code ignored;  // woken, or time to look
    co_await waiter.timer->async_wait(asio::redirect_error(asio::use_awaitable, ignored));
  }
}

std::size_t TransferBudget::HeldBy(std::uint64_t client, std::size_t pool) const {
  const auto own = shares_.find(client);
  return own == shares_.end() ? 0 : own->second.bytes[pool];
}

// `waiter`: whose place in the line it is; null: the last.
bool TransferBudget::MayTake(const Ask& ask, const Waiter* waiter) const {
  const std::size_t number = PoolOf(ask.kind);
  const Pool& pool = pools_[number];
  if (ask.body && charges_.contains(ask.body.get())) return true;
  const std::size_t own = HeldBy(ask.client, number);
  if (!waiters_.empty()) {
    const Waiter* next = NextWaiter(number);
    if (next != nullptr && next != waiter && HeldBy(next->ask.client, number) <= own) return false;
  }
  if (pool.held + ask.bytes > pool.capacity) return ask.bytes > pool.capacity && !pool.oversized_under_way;
  return number == 1 || own == 0 || own + ask.bytes <= kShare * (pool.capacity - pool.held - ask.bytes);
}

// The oldest of the client that holds least.
TransferBudget::Waiter* TransferBudget::NextWaiter(std::size_t pool) const {
  Waiter* next = nullptr;
  for (Waiter* waiter : waiters_) {
    if (PoolOf(waiter->ask.kind) != pool) continue;
    if (next == nullptr || HeldBy(waiter->ask.client, pool) < HeldBy(next->ask.client, pool)) next = waiter;
  }
  return next;
}

std::optional<TransferBudget::Hold> TransferBudget::Take(const Ask& ask, Clock::time_point now, const Waiter* waiter) {
  const bool fits = MayTake(ask, waiter);
  const bool is_beyond = !fits && ask.kind == Kind::kVitalReply && reserve_held_ + ask.bytes <= kReserve;
  if (!fits && !is_beyond) return std::nullopt;
  const std::size_t number = PoolOf(ask.kind);
  const auto time = kGrace + std::chrono::milliseconds(ask.bytes * 1000 / kRate);
  // What may fail for want of memory comes first.
  Entries made;
  made.push_back({ask.body.get(), now + time, ask.holder, ask.client, ask.kind == Kind::kUpload, ask.bytes});
  if (!ask.body) made.front().charge = &made.front();
  Share& own = shares_[ask.client];
  Charge& charge = charges_[made.front().charge];
  const auto entry = made.begin();
  entries_.splice(entries_.end(), made);
  ++own.holds;
  if (++charge.holders == 1) {
    Pool& pool = pools_[number];
    charge.client = ask.client;
    charge.is_beyond = is_beyond;
    charge.bytes = is_beyond || pool.held + ask.bytes <= pool.capacity ? ask.bytes : 0;
    pool.oversized_under_way = pool.oversized_under_way || charge.bytes == 0;
    (is_beyond ? reserve_held_ : pool.held) += charge.bytes;
    own.bytes[number] += charge.bytes;
  }
  if (waiter != nullptr) WakeNext(number);  // there may be room for the next one too
  return Hold(this, entry, ask.body);
}

// Each is told once; its room comes back when its connection has ended, or its request was let go.
TransferBudget::Victims TransferBudget::ChooseVictims(const Ask& ask, Clock::time_point now) {
  Victims victims;
  const std::size_t number = PoolOf(ask.kind);
  const bool for_upload = ask.kind == Kind::kUpload, is_vital = ask.kind == Kind::kVitalReply;
  std::uint64_t largest = ask.client;
  for (const auto& [client, share] : shares_) {
    const std::size_t most = HeldBy(largest, number);
    // A tie is broken by number, so that it does not depend on the table's order.
    if (share.bytes[number] > most || (share.bytes[number] == most && client < largest)) largest = client;
  }
  const auto tell = [&](Entry& entry, std::vector<std::shared_ptr<Connection>>& whom) {
    auto connection = entry.holder.lock();
    entry.holder.reset();
    if (!connection) return false;
    whom.push_back(std::move(connection));
    ++cut_;
    return true;
  };
  if (for_upload) {
    if (HeldBy(largest, number) > HeldBy(ask.client, number) + ask.bytes) {
      for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
        if (entry->is_upload && entry->client == largest && tell(*entry, victims.displaced)) return victims;
      }
    }
    for (Entry& entry : entries_) {
      if (entry.is_upload && entry.client != ask.client && now >= entry.entitled_until) tell(entry, victims.displaced);
    }
    return victims;
  }
  for (Entry& entry : entries_) {
    const bool is_late = !entry.is_upload && now >= entry.entitled_until;
    if (is_late && entry.client == largest && (is_vital || largest != ask.client)) tell(entry, victims.cut);
  }
  return victims;
}

// It belongs to its coroutine's thread: nothing of it may be left here once it is posted there.
void TransferBudget::WakeNext(std::size_t pool) {
  Waiter* next = NextWaiter(pool);
  if (next == nullptr) return;
  const std::weak_ptr<asio::steady_timer> timer = next->timer;
  try {
    asio::post(next->timer->get_executor(), [timer] {
      if (const auto here = timer.lock()) here->cancel();
    });
  } catch (const std::exception&) {  // no memory: it looks by itself
  }
}

void TransferBudget::Release(Entries::iterator entry) {
  const std::lock_guard lock(mutex_);
  const std::size_t number = entry->is_upload ? 1 : 0;
  const auto found = charges_.find(entry->charge);
  Charge& charge = found->second;
  const auto own = shares_.find(entry->client);
  entries_.erase(entry);
  if (--charge.holders == 0) {
    Pool& pool = pools_[number];
    (charge.is_beyond ? reserve_held_ : pool.held) -= charge.bytes;
    if (charge.bytes == 0) pool.oversized_under_way = false;
    shares_.at(charge.client).bytes[number] -= charge.bytes;
    charges_.erase(found);
  } else if (charge.client == own->first) {
    // From now on it counts against one of those who still read it.
    const auto heir = std::ranges::find_if(entries_, [&](const Entry& other) { return other.charge == found->first; });
    own->second.bytes[number] -= charge.bytes;
    charge.client = heir->client;
    shares_.at(charge.client).bytes[number] += charge.bytes;
  }
  if (--own->second.holds == 0) shares_.erase(own);
  if (!waiters_.empty()) WakeNext(number);
}

void TransferBudget::Settle(Entries::iterator entry) {
  const std::lock_guard lock(mutex_);
  entry->entitled_until = Clock::time_point::max();
}

TransferBudget::Stats TransferBudget::stats() const {
  const std::lock_guard lock(mutex_);
  return {pools_[0].held + pools_[1].held, waiters_.size(), refused_, cut_};
}

}  // namespace terrace::server
