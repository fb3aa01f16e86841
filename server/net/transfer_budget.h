// The memory of bodies on their way: replies that clients have not taken yet, and bodies of requests that are not
// answered.
//
// It is divided into rooms that take nothing from one another: half for small replies, which are up to an eighth of
// their room, a quarter for larger ones, a quarter for uploads. What is larger than its room is under way one at a time
// beside it, as a room of its own. The same holds in each room:
// - A body that many replies share counts once.
// - Bodies that find no room wait for it (HoldWhenRoom). Next is a body of the client that has used the room least
//   lately, in bytes times seconds, what it holds now included; of those alike the oldest.
// - One client gets two thirds of what is for replies, or one reply: there is room for the next client.
// - Who waits takes from others. A client has kGrace to take a reply that is on offer, and gets a second back for each
//   kRate bytes that it takes: it is late once it lags kGrace behind that rate. Late replies are cut off, those of the
//   client that holds most, if that is more than the client of the one who waits. Of uploads the newest one of the
//   client that holds most is displaced, if that client holds more than the one who waits would; and those of others
//   that have not arrived whole in kGrace and a second for each kRate bytes. A client's own bodies wait for one
//   another.
//
// What tells operators how the server is may go beyond all rooms by kReserve: it is wanted most when there is no room.
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

  // `now`: what the time is.
  explicit TransferBudget(std::size_t capacity, std::function<Clock::time_point()> now = Clock::now);

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
  std::optional<Hold> TryHold(const Ask& ask);

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
  struct Share {  // of a client
    std::size_t bytes = 0;
    std::size_t holds = 0;
    // Byte-seconds until `as_of`, of which half are forgotten every ten seconds.
    double used = 0;
    Clock::time_point as_of;
  };
  struct Room {
    std::size_t capacity = 0;
    bool takes_one = false;  // of any size
    std::size_t held = 0;
    std::unordered_map<std::uint64_t, Share> shares = {};  // by client; those that hold anything or did so lately
    std::size_t sweep_at = 64;                             // shares
  };
  enum RoomNumber : std::size_t { kSmall, kLarge, kOversized, kUploads, kOversizedUpload, kRooms };

  struct Entry {
    const void* charge;  // what it is counted under: the body, or the entry itself where nobody shares it
    std::size_t room = 0;
    Clock::time_point late_at;         // max: it is not the client's turn
    std::weak_ptr<Connection> holder;  // not told to make room yet
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

  std::size_t RoomOf(const Ask& ask) const;
  // mutex_ is held, as for the following.
  static std::size_t HeldBy(std::uint64_t client, const Room& room);
  static void Age(Share& share, Clock::time_point now);
  static std::uint64_t Claim(std::uint64_t client, const Room& room, Clock::time_point now);
  static Share& ShareOf(std::uint64_t client, Room& room, Clock::time_point now);
  bool HasRoom(const Ask& ask) const;
  bool MayTake(const Ask& ask, Clock::time_point now, const Waiter* waiter) const;
  Waiter* NextWaiter(std::size_t room, Clock::time_point now) const;
  void ChooseLate(const Ask& ask, Clock::time_point now, Victims& victims);
  void ChooseUploads(const Ask& ask, Clock::time_point now, Victims& victims);
  bool Tell(Entry& entry, std::vector<std::shared_ptr<Connection>>& whom);
  std::optional<Hold> Take(const Ask& ask, Clock::time_point now, const Waiter* waiter);
  void WakeNext(std::size_t room, Clock::time_point now);

  void Release(Entries::iterator entry);
  void Took(Entries::iterator entry, std::size_t bytes);
  void Settle(Entries::iterator entry);

  const std::function<Clock::time_point()> now_;
  mutable std::mutex mutex_;
  Entries entries_;  // the oldest first
  std::unordered_map<const void*, Charge> charges_;
  std::array<Room, kRooms> rooms_;
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

  // The client has taken so many more bytes of the reply. Its time begins with the first call: until then the reply is
  // being made.
  void Took(std::size_t bytes) {
    if (budget_) budget_->Took(entry_, bytes);
  }

  // The upload is complete, and counts until the end, but is late no more.
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
