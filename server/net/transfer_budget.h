// The memory of bodies on their way: replies that clients have not taken yet, which get three quarters of it, and
// bodies of requests that are not answered, which get the rest. Neither keeps the other out.
//
// A body that many replies share counts once. Bodies that find no room wait for it (HoldWhenRoom), those of the client
// that holds least first. One client gets two thirds of the room for replies, or one reply: there is room for the next
// client. Who waits takes from others:
// - Replies that have had more than their time (kGrace, and a second for each kRate bytes) are cut off, those of the
//   client that holds most.
// - Of uploads the newest one of the client that holds most is displaced, if that client holds more than the one who
//   waits would; and those of others that have not arrived whole in their time.
// A client's own bodies wait for one another. A single body that is larger than all the room may be under way beside
// it. What tells operators how the server is may go beyond it by kReserve: it is wanted most when there is no room.
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
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/asio.h"
#include "server/net/connection_set.h"

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

  explicit TransferBudget(std::size_t capacity)
      : pools_{{capacity - capacity / kUploadShare, 0, false}, {capacity / kUploadShare, 0, false}} {}

  // Gives its room back when it ends, on whatever thread.
  class Hold;

  enum class Kind : std::uint8_t { kReply, kVitalReply, kUpload };

  struct Ask {
    Kind kind = Kind::kReply;
    std::size_t bytes = 0;
    std::shared_ptr<const std::string> body;  // lives as long as it is counted; null: memory that nobody shares
    std::uint64_t client = 0;                 // who it counts against
    std::weak_ptr<Connection> holder;         // who would be cut off or displaced
  };

  // Room until the hold ends. Nothing: there is none now.
  std::optional<Hold> TryHold(const Ask& ask, Clock::time_point now = Clock::now());

  // Waits for room, at most until `deadline`; nothing then. Give no body: what waits must not take the memory that it
  // waits for. The coroutine has to run on a single thread.
  asio::awaitable<std::optional<Hold>> HoldWhenRoom(Ask ask, Clock::time_point deadline);

  struct Stats {
    std::size_t held_bytes = 0;
    std::size_t waiting = 0;
    std::uint64_t refused = 0;  // whose deadline came before there was room
    std::uint64_t cut = 0;      // cut off or displaced
  };
  Stats stats() const;

 private:
  static constexpr std::size_t kUploadShare = 4;  // a quarter is for request bodies

  struct Pool {
    std::size_t capacity = 0, held = 0;
    bool oversized_under_way = false;
  };
  struct Entry {
    const void* charge;  // what it is counted under: the body, or the entry itself where nobody shares it
    Clock::time_point entitled_until;
    std::weak_ptr<Connection> holder;  // not told to make room yet
    std::uint64_t client = 0;
    bool is_upload = false;
    std::size_t bytes = 0;
  };
  using Entries = std::list<Entry>;
  struct Charge {
    std::size_t bytes = 0;  // 0: beside the budget
    std::size_t holders = 0;
    bool is_beyond = false;    // in the reserve
    std::uint64_t client = 0;  // one of the holders'
  };
  struct Share {                    // of a client
    std::size_t bytes[2] = {0, 0};  // in each pool
    std::size_t holds = 0;
  };
  class Waiter;
  struct Victims {
    std::vector<std::shared_ptr<Connection>> cut, displaced;
  };

  static std::size_t PoolOf(Kind kind) { return kind == Kind::kUpload ? 1 : 0; }
  // mutex_ is held, as for the following.
  std::size_t HeldBy(std::uint64_t client, std::size_t pool) const;
  bool MayTake(const Ask& ask, const Waiter* waiter) const;
  Waiter* NextWaiter(std::size_t pool) const;
  Victims ChooseVictims(const Ask& ask, Clock::time_point now);
  std::optional<Hold> Take(const Ask& ask, Clock::time_point now, const Waiter* waiter);
  void WakeNext(std::size_t pool);

  void Release(Entries::iterator entry);
  void Settle(Entries::iterator entry);

  mutable std::mutex mutex_;
  Entries entries_;  // the oldest first
  std::unordered_map<const void*, Charge> charges_;
  std::unordered_map<std::uint64_t, Share> shares_;  // by client; those that hold anything
  Pool pools_[2];                                    // replies, uploads
  std::list<Waiter*> waiters_;                       // the oldest first
  std::size_t reserve_held_ = 0;
  std::uint64_t refused_ = 0, cut_ = 0;
};

class TransferBudget::Hold {
 public:
  Hold() = default;  // of nothing
  Hold(Hold&& other) noexcept
      : budget_(std::exchange(other.budget_, nullptr)), entry_(other.entry_), body_(std::move(other.body_)) {}
  Hold& operator=(Hold&& other) noexcept {
    std::swap(budget_, other.budget_);
    std::swap(entry_, other.entry_);
    std::swap(body_, other.body_);
    return *this;
  }
  ~Hold() {
    if (budget_) budget_->Release(entry_);
  }

  // What is held is complete, and counts until the end, but is late no more.
  void Settle() {
    if (budget_) budget_->Settle(entry_);
  }

  // Of a hold without one: lives as long as it is counted.
  void Keep(std::shared_ptr<const std::string> body) { body_ = std::move(body); }

 private:
  friend class TransferBudget;
  Hold(TransferBudget* budget, Entries::iterator entry, std::shared_ptr<const std::string> body)
      : budget_(budget), entry_(entry), body_(std::move(body)) {}

  TransferBudget* budget_ = nullptr;
  Entries::iterator entry_;
  std::shared_ptr<const std::string> body_;
};

}  // namespace terrace::server
