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
                                                            Clock::time_point now, std::uint64_t client) {
  return Take(nullptr, bytes, holder, now, Kind::kUpload, client);
}

std::optional<TransferBudget::Hold> TransferBudget::Take(Body body, std::size_t bytes,
                                                         const std::weak_ptr<Connection>& holder, Clock::time_point now,
                                                         Kind kind, std::uint64_t client) {
  if (bytes <= kFreeBytes) return Hold();
  std::unique_lock lock(mutex_);
  if (!charges_.contains(body.get()) && !MayTake(bytes, kind, client)) {
    ++refused_;
    const std::vector<std::shared_ptr<Connection>> overdue = Overdue(now, /*only_uploads=*/kind == Kind::kUpload);
    lock.unlock();
    for (const auto& connection : overdue) connection->Abort();
    return std::nullopt;
  }
  const auto time = kGrace + std::chrono::milliseconds(bytes * 1000 / kRate);
  const auto entry = entries_.insert(entries_.end(), Entry{body.get(), now + time, holder});
  if (!body) entry->charge = &*entry;
  Charge& charge = charges_[entry->charge];
  if (++charge.holders == 1) {
    const bool fits = Fits(bytes, kind);
    charge.bytes = fits ? bytes : 0;
    held_ += charge.bytes;
    charge.client = client;
    if (client != 0 && charge.bytes > 0) held_by_[client] += charge.bytes;
    charge.is_upload = kind == Kind::kUpload;
    if (charge.is_upload) uploads_held_ += charge.bytes;
    oversized_under_way_ = oversized_under_way_ || !fits;
  }
  return Hold(this, entry, std::move(body));
}

bool TransferBudget::Fits(std::size_t bytes, Kind kind) const {
  return held_ + bytes <= capacity_ + (kind == Kind::kVitalReply ? kReserve : 0);
}

bool TransferBudget::MayTake(std::size_t bytes, Kind kind, std::uint64_t client) const {
  const auto own = held_by_.find(client);
  const std::size_t free = capacity_ - std::min(held_, capacity_);
  if (kind != Kind::kVitalReply && own != held_by_.end() && own->second > kShare * free) return false;
  if (kind == Kind::kUpload && uploads_held_ > 0 && uploads_held_ + bytes > capacity_ / kUploadShare) return false;
  return Fits(bytes, kind) || (bytes > capacity_ && !oversized_under_way_);
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
  const auto charge = charges_.find(entry->charge);
  if (--charge->second.holders == 0) {
    held_ -= charge->second.bytes;
    if (const auto own = held_by_.find(charge->second.client); own != held_by_.end()) {
      own->second -= charge->second.bytes;
      if (own->second == 0) held_by_.erase(own);
    }
    if (charge->second.is_upload) uploads_held_ -= charge->second.bytes;
    if (charge->second.bytes == 0) oversized_under_way_ = false;
    charges_.erase(charge);
  }
  entries_.erase(entry);
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
