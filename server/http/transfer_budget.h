// The memory of bodies on their way: replies that clients have not taken yet, and bodies of requests that are not
// answered. Request bodies get a quarter of it: whoever announces uploads must not keep others from their replies.
//
// A body that many replies share counts once. Where there is no room for one more, it is refused, and replies that have
// had more than their time (kGrace, and a second for each kRate bytes) are cut off, so that those who read slowly do
// not keep others out for long. One client gets two thirds of the room at most, or one reply. A single body that is
// larger than the whole budget may be under way beside it. What tells operators how the server is may go beyond the
// budget by kReserve: it is wanted most when there is no room.
//
// Thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/http/connection_set.h"
#include "server/http/response.h"

namespace terrace::server {

class TransferBudget {
 public:
  using Clock = std::chrono::steady_clock;

  // Bodies up to this size are not counted: the number of connections bounds them.
  static constexpr std::size_t kFreeBytes = 16 * 1024;
  static constexpr std::chrono::seconds kGrace{2};
  static constexpr std::size_t kRate = std::size_t{1} << 20;
  static constexpr std::size_t kReserve = std::size_t{1} << 20;
  static constexpr std::size_t kShare = 2;  // a client's, of what is free: room is left for the next one

  explicit TransferBudget(std::size_t capacity) : capacity_(capacity) {}

  // Gives its room back when it ends.
  class Hold;

  enum class Kind : std::uint8_t { kReply, kVitalReply, kUpload };

  // Room for a reply's body until the hold ends. Nothing: there is none, and the body must be let go. `holder` is who
  // would be cut off, `client` whose share it counts against; 0: nobody's.
  std::optional<Hold> TryHold(Body body, const std::weak_ptr<Connection>& holder, Clock::time_point now = Clock::now(),
                              Kind kind = Kind::kReply, std::uint64_t client = 0);
  // The same for `bytes` of a request's body, which nobody shares.
  std::optional<Hold> TryHold(std::size_t bytes, const std::weak_ptr<Connection>& holder,
                              Clock::time_point now = Clock::now());

  struct Stats {
    std::size_t held_bytes = 0;
    std::uint64_t refused = 0, cut = 0;
  };
  Stats stats() const;

 private:
  struct Entry {
    const void* charge;  // what it is counted under: the body, or the entry itself where nobody shares it
    Clock::time_point entitled_until;
    std::weak_ptr<Connection> holder;
    std::uint64_t client = 0;
  };
  using Entries = std::list<Entry>;
  struct Charge {
    std::size_t bytes = 0;  // 0: beside the budget
    std::size_t holders = 0;
    bool is_upload = false;
    bool is_beyond = false;    // in the reserve
    std::uint64_t client = 0;  // one of the holders'
  };
  struct Share {  // of a client
    std::size_t bytes = 0, holds = 0;
  };

  bool MayTake(std::size_t bytes, Kind kind, std::uint64_t client) const;  // mutex_ is held
  // mutex_ is held. Uploads make room for uploads alone: replies have none to give them.
  std::vector<std::shared_ptr<Connection>> Overdue(Clock::time_point now, bool only_uploads);
  std::optional<Hold> Take(Body body, std::size_t bytes, const std::weak_ptr<Connection>& holder, Clock::time_point now,
                           Kind kind, std::uint64_t client);
  void Release(Entries::iterator entry);
  void Settle(Entries::iterator entry);

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  Entries entries_;
  std::unordered_map<const void*, Charge> charges_;
  std::unordered_map<std::uint64_t, Share> shares_;  // by client; those that hold anything
  std::size_t reserve_held_ = 0;                     // beside held_
  std::size_t held_ = 0;
  std::size_t uploads_held_ = 0;  // of these, request bodies
  bool oversized_under_way_ = false;
  std::uint64_t refused_ = 0, cut_ = 0;
};

class TransferBudget::Hold {
 public:
  Hold() = default;  // of nothing
  Hold(Hold&& other) noexcept
      : budget_(std::exchange(other.budget_, nullptr)), entry_(other.entry_), body_(std::move(other.body_)) {}
  Hold& operator=(Hold&&) = delete;
  ~Hold() {
    if (!budget_) return;
    budget_->Release(entry_);
  }

  // What is held is complete, and counts until the end, but its holder is no longer cut off for it.
  void Settle() {
    if (budget_) budget_->Settle(entry_);
  }

 private:
  friend class TransferBudget;
  Hold(TransferBudget* budget, Entries::iterator entry, Body body)
      : budget_(budget), entry_(entry), body_(std::move(body)) {}

  TransferBudget* budget_ = nullptr;
  Entries::iterator entry_;
  Body body_;  // lives as long as it is counted
};

}  // namespace terrace::server
