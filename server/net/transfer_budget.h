// The memory limit for bodies in transfer: replies that clients have not taken yet, and bodies of requests that are not
// answered yet.
//
// The memory is divided into separate pools: half for small replies, which are up to an eighth of their pool, a quarter
// for larger replies, a quarter for uploads. Replies and uploads that are larger than their pool each have a further
// pool, which holds one of them at a time. The same rules hold in each pool:
// - A body that many replies share counts once.
// - Bodies that do not fit wait (HoldWhenRoom). The oldest body of the client with the smallest use comes next. Use is
//   bytes times seconds, with a half-life of ten seconds, and includes what the client holds now.
// - The first reply of a client may have any size. A client with several replies may hold at most two thirds of the
//   memory that other clients do not use. This leaves memory for the next client.
// - A client has kGrace to take a reply that is being sent, and gains one second per kRate bytes that it takes. Its
//   reply is late once it lags kGrace behind this rate. An upload is late if it has not arrived within kGrace plus one
//   second per kRate bytes.
// - A waiting reply takes memory from the client with late replies that holds most, if it holds more than the waiting
//   client: its late replies are cut off.
// - A waiting upload takes memory from the client that holds most, if it holds more than the waiting client would: its
//   newest upload is displaced. Else the late uploads of all other clients are displaced.
// - A waiting body takes no memory from other bodies of its own client, unless it is a reply about the server's state.
//
// Replies about the server's state, for operators, may exceed all pools by kReserve: they matter most when memory is
// short.
//
// Thread-safe.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "server/asio/asio.h"
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
  static constexpr std::size_t kHeldPerFree = 2;  // bytes that a client may hold, as a multiple of those left free

  // `now`: the clock.
  explicit TransferBudget(std::size_t capacity, std::function<Clock::time_point()> now = Clock::now);

  // Memory in use. Released when the object is destroyed, on any thread.
  class Hold;

  enum class Kind : std::uint8_t { kReply, kVitalReply, kUpload };

  struct HoldRequest {
    Kind kind = Kind::kReply;
    std::size_t bytes = 0;
    std::shared_ptr<const std::string> body;  // kept alive while it counts; null: memory that is not shared
    std::uint64_t client = 0;                 // the client whose share it counts against
    std::weak_ptr<Connection> holder;         // the connection that may be cut off or displaced
  };

  // Takes memory until the hold is destroyed. Returns nothing if there is none now.
  std::optional<Hold> TryHold(const HoldRequest& request);

  // Waits for memory until `deadline`; returns nothing then. `request` should have no body, because a waiting body
  // would itself take memory. The coroutine must run on a single thread.
  asio::awaitable<std::optional<Hold>> HoldWhenRoom(HoldRequest request, Clock::time_point deadline);

  struct Stats {
    std::size_t held_bytes = 0;
    std::size_t waiting = 0;
    std::uint64_t refused = 0;  // by their deadline, while they waited
    std::uint64_t cut = 0;      // cut off or displaced
  };
  Stats stats() const;

 private:
  struct Share {  // of a client
    std::size_t bytes = 0;
    std::size_t holds = 0;
    // Byte-seconds up to `as_of`, with a half-life of ten seconds.
    double used = 0;
    Clock::time_point as_of;
  };
  struct Pool {
    std::size_t capacity = 0;
    bool takes_one = false;  // of any size
    std::size_t held = 0;
    std::unordered_map<std::uint64_t, Share> shares = {};  // by client; those that hold anything or did so lately
    std::size_t sweep_at = 64;                             // shares
  };
  enum PoolIndex : std::size_t { kSmall, kLarge, kOversized, kUploads, kOversizedUpload, kPools };

  struct Entry {
    const void* charge;  // key of its charge: the body, or the entry itself if it is not shared
    std::size_t pool = 0;
    Clock::time_point late_at;         // max: its time has not begun
    std::weak_ptr<Connection> holder;  // empty once it was told to release memory
    std::uint64_t client = 0;
  };
  using Entries = std::list<Entry>;
  struct Charge {
    std::size_t bytes = 0;
    std::size_t holders = 0;
    bool is_beyond = false;    // in the reserve
    std::uint64_t client = 0;  // one of the holders'
  };
  class Waiter;
  struct Victims {
    std::vector<std::shared_ptr<Connection>> cut, displaced;
  };

  std::size_t PoolOf(const HoldRequest& request) const;
  // mutex_ is held, as for the following.
  static std::size_t HeldBy(std::uint64_t client, const Pool& pool);
  static void Age(Share& share, Clock::time_point now);
  // A client's recent use plus what it may use before it is late, in steps. The oldest waiter of the client with the
  // smallest claim is next.
  static std::uint64_t ClaimOf(std::uint64_t client, const Pool& pool, Clock::time_point now);
  static Share& ShareOf(std::uint64_t client, Pool& pool, Clock::time_point now);
  bool HasRoom(const HoldRequest& request) const;
  bool MayTake(const HoldRequest& request, Clock::time_point now, const Waiter* waiter) const;
  Waiter* NextWaiter(std::size_t pool, Clock::time_point now) const;
  void ChooseLate(const HoldRequest& request, Clock::time_point now, Victims& victims);
  void ChooseUploads(const HoldRequest& request, Clock::time_point now, Victims& victims);
  bool Tell(Entry& entry, std::vector<std::shared_ptr<Connection>>& whom);
  std::optional<Hold> Take(const HoldRequest& request, Clock::time_point now, const Waiter* waiter);
  void WakeNext(std::size_t pool, Clock::time_point now);

  void Release(Entries::iterator entry);
  void AddTaken(Entries::iterator entry, std::size_t bytes);
  void EndUpload(Entries::iterator entry);

  const std::function<Clock::time_point()> now_;
  mutable std::mutex mutex_;
  Entries entries_;  // the oldest first
  std::unordered_map<const void*, Charge> charges_;
  std::array<Pool, kPools> pools_;
  std::list<Waiter*> waiters_;  // the oldest first
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

  // Call this when the reply is made and the client can take it. It cannot be late before.
  void BeginReply() { AddTaken(0); }
  // Call this when the client has taken further bytes of the reply.
  void AddTaken(std::size_t bytes) {
    if (budget_) budget_->AddTaken(entry_, bytes);
  }
  // Call this when the upload is complete. It still counts until the hold is destroyed, but can no longer be late.
  void EndUpload() {
    if (budget_) budget_->EndUpload(entry_);
  }

  // Keeps `body` alive as long as the hold. For holds without a body.
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
