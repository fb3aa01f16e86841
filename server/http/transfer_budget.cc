#include "server/http/transfer_budget.h"

#include <algorithm>

namespace terrace::server {
namespace {

constexpr std::size_t kUploadShare = 4;  // a quarter of the budget is for request bodies

}  // namespace

std::optional<TransferBudget::Hold> TransferBudget::TryHold(Body body, const std::weak_ptr<Connection>& holder,
                                                            Clock::time_point now, Kind kind, std::uint64_t client) {
  const std::size_t bytes = body ? body->size() : 0;
  return Take(std::move(body), bytes, holder, now, kind, client);
}

std::optional<TransferBudget::Hold> TransferBudget::TryHold(std::size_t bytes, const std::weak_ptr<Connection>& holder,
                                                            Clock::time_point now) {
  return Take(nullptr, bytes, holder, now, Kind::kUpload, 0);  // uploads have a bound of their own
}

std::optional<TransferBudget::Hold> TransferBudget::Take(Body body, std::size_t bytes,
                                                         const std::weak_ptr<Connection>& holder, Clock::time_point now,
                                                         Kind kind, std::uint64_t client) {
  if (bytes <= kFreeBytes) return Hold();
  std::unique_lock lock(mutex_);
  const bool fits = charges_.contains(body.get()) || MayTake(bytes, kind, client);
  const bool is_beyond = !fits && kind == Kind::kVitalReply && reserve_held_ + bytes <= kReserve;
  if (!fits && !is_beyond) {
    ++refused_;
    const std::vector<std::shared_ptr<Connection>> overdue = Overdue(now, /*only_uploads=*/kind == Kind::kUpload);
    lock.unlock();
    for (const auto& connection : overdue) connection->Abort();
    return std::nullopt;
  }
  const auto time = kGrace + std::chrono::milliseconds(bytes * 1000 / kRate);
  // What may fail for want of memory comes first.
  Entries made;
  made.push_back({body.get(), now + time, holder, client});
  if (!body) made.front().charge = &made.front();
  Share& own = shares_[client];
  Charge& charge = charges_[made.front().charge];
  const auto entry = made.begin();
  entries_.splice(entries_.end(), made);
  ++own.holds;
  if (++charge.holders == 1) {
    charge.client = client;
    charge.is_upload = kind == Kind::kUpload;
    charge.is_beyond = is_beyond;
    charge.bytes = is_beyond || held_ + bytes <= capacity_ ? bytes : 0;
    oversized_under_way_ = oversized_under_way_ || charge.bytes == 0;
    (is_beyond ? reserve_held_ : held_) += charge.bytes;
    if (charge.is_upload) uploads_held_ += charge.bytes;
    own.bytes += charge.bytes;
  }
  return Hold(this, entry, std::move(body));
}

bool TransferBudget::MayTake(std::size_t bytes, Kind kind, std::uint64_t client) const {
  if (kind == Kind::kUpload && uploads_held_ > 0 && uploads_held_ + bytes > capacity_ / kUploadShare) return false;
  if (held_ + bytes > capacity_) return bytes > capacity_ && !oversized_under_way_;
  const auto own = shares_.find(client);
  if (client == 0 || own == shares_.end() || own->second.bytes == 0) return true;
  return own->second.bytes + bytes <= kShare * (capacity_ - held_ - bytes);
}

// Each is told once; its room comes back when its connection has ended.
std::vector<std::shared_ptr<Connection>> TransferBudget::Overdue(Clock::time_point now, bool only_uploads) {
  std::vector<std::shared_ptr<Connection>> overdue;
  for (Entry& entry : entries_) {
    if (now < entry.entitled_until) continue;
    if (only_uploads && !charges_.at(entry.charge).is_upload) continue;
    if (auto connection = entry.holder.lock()) overdue.push_back(std::move(connection));
    entry.holder.reset();
  }
  cut_ += overdue.size();
  return overdue;
}

void TransferBudget::Release(Entries::iterator entry) {
  const std::lock_guard lock(mutex_);
  const auto found = charges_.find(entry->charge);
  Charge& charge = found->second;
  const auto own = shares_.find(entry->client);
  entries_.erase(entry);
  if (--charge.holders == 0) {
    (charge.is_beyond ? reserve_held_ : held_) -= charge.bytes;
    if (charge.is_upload) uploads_held_ -= charge.bytes;
    if (charge.bytes == 0) oversized_under_way_ = false;
    shares_.at(charge.client).bytes -= charge.bytes;
    charges_.erase(found);
  } else if (charge.client == own->first) {
    // From now on it counts against one of those who still read it.
    const auto heir = std::ranges::find_if(entries_, [&](const Entry& other) { return other.charge == found->first; });
    own->second.bytes -= charge.bytes;
    charge.client = heir->client;
    shares_.at(charge.client).bytes += charge.bytes;
  }
  if (--own->second.holds == 0) shares_.erase(own);
}

void TransferBudget::Settle(Entries::iterator entry) {
  const std::lock_guard lock(mutex_);
  entry->holder.reset();
}

TransferBudget::Stats TransferBudget::stats() const {
  const std::lock_guard lock(mutex_);
  return {held_, refused_, cut_};
}

}  // namespace terrace::server
