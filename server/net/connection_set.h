// The connections that are open: their cap, and their orderly end.
//
// Thread-safe. A connection is in the set from its construction to its destruction.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <unordered_map>
#include <vector>

namespace terrace::server {

// What the set may ask and tell a connection, from any thread.
class Connection {
 public:
  virtual ~Connection() = default;

  enum class Phase : std::uint8_t {
    kIdle,      // a reply was sent, no next request has arrived
    kReceives,  // no complete request, head and body, has arrived yet, or TLS is being negotiated
    kServes,
  };
  virtual Phase phase() const = 0;

  // Close; where a request is being served, after its reply.
  virtual void Evict() = 0;
  // Finish the request that has begun, or one that begins in a moment, and close.
  virtual void Drain() = 0;
  virtual void Abort() = 0;
  // Refuse the request whose body takes room that is needed.
  virtual void Displace() { Abort(); }
};

class ConnectionSet {
 public:
  // `most_of_one`: connections of one client at a time; 0: as many as there may be in all.
  explicit ConnectionSet(std::size_t capacity, std::size_t most_of_one = 0)
      : capacity_(capacity), most_of_one_(most_of_one) {}

  // A connection that comes while the set drains is told so. `client` is whom it counts for; empty: nobody.
  void Add(const std::shared_ptr<Connection>& connection, const std::string& client = "");
  void Remove(const Connection* connection);

  std::size_t size() const;
  bool full() const { return size() >= capacity_; }
  bool HasTooMany(const std::string& client) const;

  // Connections that were turned away.
  void CountRefused() { refused_.fetch_add(1, std::memory_order_relaxed); }
  std::uint64_t refused() const { return refused_.load(std::memory_order_relaxed); }
  bool draining() const;

  // Makes room for a connection of `newcomer`: tells another one to close. It is one of the client that has most
  // connections, the newcomer's counted, and of no client that has fewer than the newcomer's. Of that client the oldest
  // idle one goes first, then the oldest without a complete request; last, if it is another client than the newcomer's
  // and has more, its newest, whatever that is at. A connection of nobody ("") counts as a client of its own.
  // False: all others have to stay.
  bool EvictOne(const std::string& newcomer);

  // From now on every connection ends after the request it is at.
  void Drain();
  void AbortAll();

  // False when connections are left after `timeout`.
  bool WaitUntilEmpty(std::chrono::milliseconds timeout);

 private:
  std::vector<std::shared_ptr<Connection>> Snapshot() const;
  void Uncount(const std::string& client);

  struct Member {
    std::weak_ptr<Connection> connection;
    std::string client;
    std::uint64_t number = 0;  // in the order in which they came
    bool is_evicted = false;   // told to go, and not counted any more
  };

  const std::size_t capacity_, most_of_one_;
  mutable std::mutex mutex_;
  std::condition_variable emptied_;
  std::unordered_map<const Connection*, Member> connections_;
  std::unordered_map<std::string, std::size_t> of_client_;  // connections of each that may stay
  std::uint64_t last_number_ = 0;
  bool draining_ = false;
  std::atomic<std::uint64_t> refused_{0};
};

}  // namespace terrace::server
