#include "server/net/transfer_budget.h"

#include <algorithm>
#include <boost/asio/post.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <cmath>
#include <exception>

namespace terrace::server {
namespace {

// How often a waiter looks for late holders. This also helps a waiter that could not be woken for want of memory.
constexpr std::chrono::milliseconds kCheckPeriod{250};

// Parts of the memory.
constexpr std::size_t kRepliesPart = 2, kLargePart = 4, kUploadsPart = 4;
// The largest small reply, as a part of its pool.
constexpr std::size_t kSmallPart = 8;

// Use is compared in steps of an eighth of the pool for a second: smaller differences do not change the order.
constexpr double kClaimSteps = 8;
constexpr std::chrono::duration<double> kHalfLife{10};

}  // namespace

// A local object of HoldWhenRoom; in waiters_ during its lifetime.
class TransferBudget::Waiter {
 public:
  Waiter(TransferBudget& owner, const HoldRequest& of_waiter, const asio::any_io_executor& executor)
      : request(of_waiter), timer(std::make_shared<asio::steady_timer>(executor)), budget(owner) {
    const std::lock_guard lock(budget.mutex_);
    budget.waiters_.push_back(this);
  }
  Waiter(const Waiter&) = delete;
  Waiter& operator=(const Waiter&) = delete;
  ~Waiter() {
    const std::lock_guard lock(budget.mutex_);
    std::erase(budget.waiters_, this);
    budget.WakeNext(budget.PoolOf(request), budget.now_());
  }

  const HoldRequest& request;
  const std::shared_ptr<asio::steady_timer> timer;
  TransferBudget& budget;
};

TransferBudget::TransferBudget(std::size_t capacity, std::function<Clock::time_point()> now) : now_(std::move(now)) {
  pools_[kSmall].capacity = capacity / kRepliesPart;
  pools_[kLarge].capacity = pools_[kOversized].capacity = capacity / kLargePart;
  pools_[kUploads].capacity = pools_[kOversizedUpload].capacity = capacity / kUploadsPart;
  pools_[kOversized].takes_one = pools_[kOversizedUpload].takes_one = true;
}

std::size_t TransferBudget::PoolOf(const HoldRequest& request) const {
  if (request.kind == Kind::kUpload) return request.bytes <= pools_[kUploads].capacity ? kUploads : kOversizedUpload;
  if (request.bytes <= pools_[kSmall].capacity / kSmallPart) return kSmall;
  return request.bytes <= pools_[kLarge].capacity ? kLarge : kOversized;
}

std::optional<TransferBudget::Hold> TransferBudget::TryHold(const HoldRequest& request) {
  if (request.bytes <= kFreeBytes) return Hold();
  const std::lock_guard lock(mutex_);
  return Take(request, now_(), nullptr);
}

asio::awaitable<std::optional<TransferBudget::Hold>> TransferBudget::HoldWhenRoom(HoldRequest request,
                                                                                  Clock::time_point deadline) {
  std::optional<Hold> hold;
  if (request.bytes <= kFreeBytes) {
    hold.emplace();
    co_return hold;
  }
  const auto executor = co_await asio::this_coro::executor;
  const Waiter waiter(*this, request, executor);
  for (;;) {
    const auto now = now_();
    Victims victims;
    {
      const std::lock_guard lock(mutex_);
      hold = Take(request, now, &waiter);
      if (!hold && now < deadline) {
        request.kind == Kind::kUpload ? ChooseUploads(request, now, victims) : ChooseLate(request, now, victims);
      }
      if (!hold && now >= deadline) ++refused_;
    }
    if (hold || now >= deadline) co_return hold;
    for (const auto& connection : victims.cut) connection->Abort();
    for (const auto& connection : victims.displaced) connection->Displace();
    waiter.timer->expires_after(std::min<Clock::duration>(deadline - now, kCheckPeriod));
    boost::system::error_code ignored;  // woken, or time for a check
    co_await waiter.timer->async_wait(asio::redirect_error(asio::use_awaitable, ignored));
  }
}

std::size_t TransferBudget::HeldBy(std::uint64_t client, const Pool& pool) {
  const auto own = pool.shares.find(client);
  return own == pool.shares.end() ? 0 : own->second.bytes;
}

// Use grows by `bytes` per second and decays by half every kHalfLife. For constant `bytes` it converges.
void TransferBudget::Age(Share& share, Clock::time_point now) {
  const double life = kHalfLife.count() / std::log(2.0);
  const double limit = static_cast<double>(share.bytes) * life;
  const double passed = std::chrono::duration<double>(now - share.as_of).count();
  share.used = limit + (share.used - limit) * std::exp(-std::max(passed, 0.0) / life);
  share.as_of = now;
}

std::uint64_t TransferBudget::ClaimOf(std::uint64_t client, const Pool& pool, Clock::time_point now) {
  const auto own = pool.shares.find(client);
  if (own == pool.shares.end()) return 0;
  Share share = own->second;
  Age(share, now);
  const double coming = static_cast<double>(share.bytes) * std::chrono::duration<double>(kGrace).count();
  const double step = std::max(static_cast<double>(pool.capacity) / kClaimSteps, 1.0);
  return static_cast<std::uint64_t>((share.used + coming) / step);
}

// Returns the aged share. From time to time, drops shares that have decayed to nothing.
TransferBudget::Share& TransferBudget::ShareOf(std::uint64_t client, Pool& pool, Clock::time_point now) {
  if (pool.shares.size() >= pool.sweep_at) {
    std::erase_if(pool.shares,
                  [&](const auto& other) { return other.second.holds == 0 && ClaimOf(other.first, pool, now) == 0; });
    pool.sweep_at = 2 * pool.shares.size() + 64;
  }
  Share& share = pool.shares[client];
  Age(share, now);
  return share;
}

// `waiter`: the waiter that asks; null: a new request, which is last in the order.
bool TransferBudget::MayTake(const HoldRequest& request, Clock::time_point now, const Waiter* waiter) const {
  const std::size_t number = PoolOf(request);
  const Pool& pool = pools_[number];
  if (request.body && charges_.contains(request.body.get())) return true;
  if (!HasRoom(request)) return false;
  if (waiters_.empty()) return true;
  const Waiter* next = NextWaiter(number, now);
  if (next == nullptr || next == waiter) return true;
  return ClaimOf(request.client, pool, now) < ClaimOf(next->request.client, pool, now);
}

// Whether the memory suffices for the request, whoever else waits.
bool TransferBudget::HasRoom(const HoldRequest& request) const {
  const std::size_t number = PoolOf(request);
  const Pool& pool = pools_[number];
  if (pool.takes_one) return pool.held == 0;
  if (pool.held + request.bytes > pool.capacity) return false;
  const std::size_t own = HeldBy(request.client, pool);
  return number == kUploads || own == 0 ||
         own + request.bytes <= kHeldPerFree * (pool.capacity - pool.held - request.bytes);
}

// The oldest waiter of the client with the smallest claim.
TransferBudget::Waiter* TransferBudget::NextWaiter(std::size_t pool, Clock::time_point now) const {
  Waiter* next = nullptr;
  std::uint64_t least = 0;
  for (Waiter* waiter : waiters_) {
    if (PoolOf(waiter->request) != pool) continue;
    const std::uint64_t claim = ClaimOf(waiter->request.client, pools_[pool], now);
    if (next == nullptr || claim < least) {
      next = waiter;
      least = claim;
    }
  }
  return next;
}

std::optional<TransferBudget::Hold> TransferBudget::Take(const HoldRequest& request, Clock::time_point now,
                                                         const Waiter* waiter) {
  const bool fits = MayTake(request, now, waiter);
  const bool is_beyond = !fits && request.kind == Kind::kVitalReply && reserve_held_ + request.bytes <= kReserve;
  if (!fits && !is_beyond) return std::nullopt;
  const std::size_t number = PoolOf(request);
  Pool& pool = pools_[number];
  auto late_at = Clock::time_point::max();
  if (request.kind == Kind::kUpload) late_at = now + kGrace + std::chrono::milliseconds(request.bytes * 1000 / kRate);
  // Allocations come first, because they may fail.
  Entries made;
  made.push_back({request.body.get(), number, late_at, request.holder, request.client});
  if (!request.body) made.front().charge = &made.front();
  Share& own = ShareOf(request.client, pool, now);
  Charge& charge = charges_[made.front().charge];
  const auto entry = made.begin();
  entries_.splice(entries_.end(), made);
  ++own.holds;
  if (++charge.holders == 1) {
    charge = {request.bytes, 1, is_beyond, request.client};
    (is_beyond ? reserve_held_ : pool.held) += request.bytes;
    own.bytes += request.bytes;
  }
  if (waiter != nullptr) WakeNext(number, now);  // there may be memory for the next one too
  return Hold(this, entry, request.body);
}

// Each connection is told once. Its memory is released when it has ended, or its request was refused.
bool TransferBudget::Tell(Entry& entry, std::vector<std::shared_ptr<Connection>>& whom) {
  auto connection = entry.holder.lock();
  entry.holder.reset();
  if (!connection) return false;
  whom.push_back(std::move(connection));
  ++cut_;
  return true;
}

// Chooses all late replies of the client that holds most, including those that were told before and have not ended yet.
// Vital replies may also take memory from their own client.
void TransferBudget::ChooseLate(const HoldRequest& request, Clock::time_point now, Victims& victims) {
  const std::size_t number = PoolOf(request);
  const Pool& pool = pools_[number];
  const bool is_vital = request.kind == Kind::kVitalReply;
  std::size_t most = is_vital ? 0 : HeldBy(request.client, pool);
  std::optional<std::uint64_t> client;
  const auto is_late = [&](const Entry& entry) {
    return entry.pool == number && now >= entry.late_at && (is_vital || entry.client != request.client);
  };
  for (const Entry& entry : entries_) {
    if (!is_late(entry)) continue;
    const std::size_t held = HeldBy(entry.client, pool);
    if (held <= most) continue;
    most = held;
    client = entry.client;
  }
  for (Entry& entry : entries_) {
    if (client && is_late(entry) && entry.client == *client) Tell(entry, victims.cut);
  }
}

void TransferBudget::ChooseUploads(const HoldRequest& request, Clock::time_point now, Victims& victims) {
  const std::size_t number = PoolOf(request);
  const Pool& pool = pools_[number];
  std::uint64_t largest = request.client;
  for (const auto& [client, share] : pool.shares) {
    const std::size_t most = HeldBy(largest, pool);
    // Ties are broken by the client's number, so that the order of the table does not matter.
    if (share.bytes > most || (share.bytes == most && client < largest)) largest = client;
  }
  if (HeldBy(largest, pool) > HeldBy(request.client, pool) + request.bytes) {
    for (auto entry = entries_.rbegin(); entry != entries_.rend(); ++entry) {
      if (entry->pool == number && entry->client == largest && Tell(*entry, victims.displaced)) return;
    }
  }
  for (Entry& entry : entries_) {
    if (entry.pool == number && entry.client != request.client && now >= entry.late_at) Tell(entry, victims.displaced);
  }
}

// The waiter belongs to its coroutine's thread, which may run at once: keep no reference here.
void TransferBudget::WakeNext(std::size_t pool, Clock::time_point now) {
  Waiter* next = NextWaiter(pool, now);
  if (next == nullptr) return;
  const std::weak_ptr<asio::steady_timer> timer = next->timer;
  try {
    asio::post(next->timer->get_executor(), [timer] {
      if (const auto here = timer.lock()) here->cancel();
    });
  } catch (const std::exception&) {  // no memory: the waiter's periodic check finds it
  }
}

void TransferBudget::Release(Entries::iterator entry) {
  const auto now = now_();
  const std::lock_guard lock(mutex_);
  const std::size_t number = entry->pool;
  const std::uint64_t client = entry->client;
  Pool& pool = pools_[number];
  const auto found = charges_.find(entry->charge);
  Charge& charge = found->second;
  Share& own = pool.shares.at(client);
  Age(own, now);
  --own.holds;
  entries_.erase(entry);
  if (--charge.holders == 0) {
    (charge.is_beyond ? reserve_held_ : pool.held) -= charge.bytes;
    own.bytes -= charge.bytes;
    charges_.erase(found);
  } else if (charge.client == client) {
    // The body now counts against another client that still reads it.
    const auto heir = std::ranges::find_if(entries_, [&](const Entry& other) { return other.charge == found->first; });
    own.bytes -= charge.bytes;
    charge.client = heir->client;
    Share& next = pool.shares.at(charge.client);
    Age(next, now);
    next.bytes += charge.bytes;
  }
  if (!waiters_.empty()) WakeNext(number, now);
}

void TransferBudget::AddTaken(Entries::iterator entry, std::size_t bytes) {
  const auto now = now_();
  const std::lock_guard lock(mutex_);
  const auto latest = now + kGrace;
  if (entry->late_at < latest) {
    entry->late_at = std::min(latest, entry->late_at + std::chrono::microseconds(bytes * 1'000'000 / kRate));
  } else {
    entry->late_at = latest;
  }
}

void TransferBudget::EndUpload(Entries::iterator entry) {
  const std::lock_guard lock(mutex_);
  entry->late_at = Clock::time_point::max();
}

TransferBudget::Stats TransferBudget::stats() const {
  const std::lock_guard lock(mutex_);
  std::size_t held = 0;
  for (const Pool& pool : pools_) held += pool.held;
  return {held, waiters_.size(), refused_, cut_};
}

}  // namespace terrace::server
