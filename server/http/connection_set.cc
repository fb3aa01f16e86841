#include "server/http/connection_set.h"

#include <optional>
#include <tuple>

namespace terrace::server {

void ConnectionSet::Add(const std::shared_ptr<Connection>& connection, const std::string& client) {
  bool draining = false;
  {
    const std::lock_guard lock(mutex_);
    connections_.emplace(connection.get(), Member{connection, client, ++last_number_});
    ++of_client_[client];
    draining = draining_;
  }
  if (draining) connection->Drain();
}

void ConnectionSet::Remove(const Connection* connection) {
  const std::lock_guard lock(mutex_);
  const auto member = connections_.find(connection);
  if (member == connections_.end()) return;
  if (const auto count = of_client_.find(member->second.client); count != of_client_.end() && --count->second == 0) {
    of_client_.erase(count);
  }
  connections_.erase(member);
  if (connections_.empty()) emptied_.notify_all();
}

std::size_t ConnectionSet::size() const {
  const std::lock_guard lock(mutex_);
  return connections_.size();
}

bool ConnectionSet::HasTooMany(const std::string& client) const {
  if (most_of_one_ == 0 || client.empty()) return false;
  const std::lock_guard lock(mutex_);
  const auto count = of_client_.find(client);
  return count != of_client_.end() && count->second >= most_of_one_;
}

bool ConnectionSet::draining() const {
  const std::lock_guard lock(mutex_);
  return draining_;
}

// Connections are told without the lock: the last reference to one may end here, and it then removes itself.
std::vector<std::shared_ptr<Connection>> ConnectionSet::Snapshot() const {
  std::vector<std::shared_ptr<Connection>> connections;
  const std::lock_guard lock(mutex_);
  connections.reserve(connections_.size());
  for (const auto& [pointer, member] : connections_) {
    if (auto connection = member.connection.lock()) connections.push_back(std::move(connection));
  }
  return connections;
}

bool ConnectionSet::EvictOne() {
  std::weak_ptr<Connection> chosen;
  {
    const std::lock_guard lock(mutex_);
    using Rank = std::tuple<Connection::Phase, std::int64_t, std::uint64_t>;
    std::optional<Rank> least_worthy;
    for (const auto& [pointer, member] : connections_) {
      const Connection::Phase phase = pointer->phase();  // good: a connection that ends waits for mutex_ in Remove
      if (phase == Connection::Phase::kServes) continue;
      const Rank rank(phase, -static_cast<std::int64_t>(of_client_.at(member.client)), member.number);
      if (least_worthy && *least_worthy < rank) continue;
      least_worthy = rank;
      chosen = member.connection;
    }
    if (!least_worthy) return false;
  }
  if (const auto connection = chosen.lock()) connection->Evict();  // else it has just ended
  return true;
}

void ConnectionSet::Drain() {
  {
    const std::lock_guard lock(mutex_);
    draining_ = true;
  }
  for (const auto& connection : Snapshot()) connection->Drain();
}

void ConnectionSet::AbortAll() {
  for (const auto& connection : Snapshot()) connection->Abort();
}

bool ConnectionSet::WaitUntilEmpty(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  return emptied_.wait_for(lock, timeout, [this] { return connections_.empty(); });
}

}  // namespace terrace::server
