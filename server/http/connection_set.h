// The connections that are open: their cap, and their orderly end.
//
// Thread-safe. A connection is in the set from its construction to its destruction.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <vector>

namespace terrace::server {

// What the set may tell a connection, from any thread.
class Connection {
 public:
  virtual ~Connection() = default;

  // Close if a reply was sent and no next request has begun.
  virtual void CloseIfIdle() = 0;
  // Finish the request that has begun, if one has, and close.
  virtual void Drain() = 0;
  virtual void Abort() = 0;
};

class ConnectionSet {
 public:
  explicit ConnectionSet(std::size_t capacity) : capacity_(capacity) {}

  // A connection that comes while the set drains is told so.
  void Add(const std::shared_ptr<Connection>& connection);
  void Remove(const Connection* connection);

  std::size_t size() const;
  bool full() const { return size() >= capacity_; }
  bool draining() const;

  // Makes room: connections that are only kept alive are the first to go.
  void CloseIdle();

  // From now on every connection ends after the request it is at.
  void Drain();
  void AbortAll();

  // False when connections are left after `timeout`.
  bool WaitUntilEmpty(std::chrono::milliseconds timeout);

 private:
  std::vector<std::shared_ptr<Connection>> Snapshot() const;

  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable emptied_;
  std::unordered_map<const Connection*, std::weak_ptr<Connection>> connections_;
  bool draining_ = false;
};

}  // namespace terrace::server
