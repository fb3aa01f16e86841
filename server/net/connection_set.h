// The open connections: their limits, and their orderly end.
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
#include <optional>
#include <string>
#include <unordered_map>
#include <vector>

namespace terrace::server {

// The calls that the set makes to a connection, from any thread.
class Connection {
 public:
  virtual ~Connection() = default;

  enum class Phase : std::uint8_t {
    kIdle,      // after a reply, until the head of the next request is complete
    kReceives,  // TLS is being negotiated, or the first head or a body is being read
    kServes,    // from the end of a head on, except while its body is being read
  };
  virtual Phase phase() const = 0;

  // Closes the connection. A request that is being served gets its reply first.
  virtual void Evict() = 0;
  // Finishes the request that has begun, or that begins until `close_at`, and closes.
  virtual void Drain(std::chrono::steady_clock::time_point close_at) = 0;
  virtual void Abort() = 0;
  // Refuses the current request, because others need the memory of its body.
  virtual void Displace() { Abort(); }
};

class ConnectionSet {
 public:
  // `max_per_client`: limit on the connections of one client; 0: none but the limit on all connections.
  explicit ConnectionSet(std::size_t capacity, std::size_t max_per_client = 0)
      : capacity_(capacity), max_per_client_(max_per_client) {}

  // A connection added while the set drains is drained at once. `client`: whose limit it counts against; empty: none.
  void Add(const std::shared_ptr<Connection>& connection, const std::string& client = "");
  void Remove(const Connection* connection);

  std::size_t size() const;
  bool full() const { return size() >= capacity_; }
  bool HasTooMany(const std::string& client) const;

  // Connections that were turned away.
  void CountRefused() { refused_.fetch_add(1, std::memory_order_relaxed); }
  std::uint64_t refused() const { return refused_.load(std::memory_order_relaxed); }
  bool draining() const;

  // Makes room for a connection of `newcomer` by closing another one: the client with the most connections
  // loses one. The new connection counts as one of the newcomer. Closes the client's oldest idle
  // connection, else its oldest without a complete request. If all are busy, closes its newest, but only if this client
  // is not the newcomer and has more connections. A connection without a client ("") counts as a client of its own.
  // Returns false if no connection can be closed.
  bool EvictOne(const std::string& newcomer);

  // From now on every connection ends after its current request. One without a request ends after `delay` and `grace`;
  // one that is added later has at least `grace` for its first request.
  void Drain(std::chrono::milliseconds delay, std::chrono::milliseconds grace);
  void AbortAll();

  // Returns false if connections are left after `timeout`.
  bool WaitUntilEmpty(std::chrono::milliseconds timeout);

 private:
  std::vector<std::shared_ptr<Connection>> Snapshot() const;
  void Uncount(const std::string& client);

  struct Member {
    std::weak_ptr<Connection> connection;
    std::string client;
    std::uint64_t number = 0;  // in the order in which they came
    bool is_evicted = false;   // told to close, and no longer counted
  };

  const std::size_t capacity_, max_per_client_;
  mutable std::mutex mutex_;
  std::condition_variable emptied_;
  std::unordered_map<const Connection*, Member> connections_;
  std::unordered_map<std::string, std::size_t> of_client_;  // connections of each that may stay
  std::uint64_t last_number_ = 0;
  struct Draining {
    std::chrono::steady_clock::time_point close_at;
    std::chrono::milliseconds grace;
  };
  std::optional<Draining> draining_;
  std::atomic<std::uint64_t> refused_{0};
};

}  // namespace terrace::server
