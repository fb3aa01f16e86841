#include "server/net/connection_set.h"

#include <algorithm>
#include <optional>
#include <tuple>

namespace terrace::server {

void ConnectionSet::Add(const std::shared_ptr<Connection>& connection, const std::string& client) {
  std::optional<Draining> draining;
  {
    const std::lock_guard lock(mutex_);
    auto& count = of_client_[client];  // first: a member without its count could not be removed
    connections_.emplace(connection.get(), Member{connection, client, ++last_number_});
    ++count;
    draining = draining_;
  }
  if (draining) connection->Drain(std::max(draining->close_at, std::chrono::steady_clock::now() + draining->grace));
}

void ConnectionSet::Remove(const Connection* connection) {
  const std::lock_guard lock(mutex_);
  const auto member = connections_.find(connection);
  if (member == connections_.end()) return;
  if (!member->second.is_evicted) Uncount(member->second.client);
  connections_.erase(member);
  if (connections_.empty()) emptied_.notify_all();
}

void ConnectionSet::Uncount(const std::string& client) {
  if (const auto count = of_client_.find(client); --count->second == 0) of_client_.erase(count);
}

std::size_t ConnectionSet::size() const {
  const std::lock_guard lock(mutex_);
  return connections_.size();
}

bool ConnectionSet::HasTooMany(const std::string& client) const {
  if (max_per_client_ == 0 || client.empty()) return false;
  const std::lock_guard lock(mutex_);
  const auto count = of_client_.find(client);
  return count != of_client_.end() && count->second >= max_per_client_;
}

bool ConnectionSet::draining() const {
  const std::lock_guard lock(mutex_);
  return draining_.has_value();
}

// Connections are called without the lock: the last reference to one may end here, and its destructor calls Remove.
std::vector<std::shared_ptr<Connection>> ConnectionSet::Snapshot() const {
  std::vector<std::shared_ptr<Connection>> connections;
  const std::lock_guard lock(mutex_);
  connections.reserve(connections_.size());
  for (const auto& [pointer, member] : connections_) {
    if (auto connection = member.connection.lock()) connections.push_back(std::move(connection));
  }
  return connections;
}

bool ConnectionSet::EvictOne(const std::string& newcomer) {
  std::shared_ptr<Connection> chosen;
  bool serves = false;
  {
    const std::lock_guard lock(mutex_);
    const auto places = [this](const std::string& client) -> std::int64_t {
      const auto count = of_client_.find(client);
      return client.empty() || count == of_client_.end() ? 0 : static_cast<std::int64_t>(count->second);
    };
    const std::int64_t of_newcomer = places(newcomer) + 1;
    using Rank = std::tuple<std::int64_t, Connection::Phase, std::int64_t>;
    std::optional<Rank> least;
    Member* of_least = nullptr;
    for (auto& [pointer, member] : connections_) {
      if (member.is_evicted) continue;
      const bool is_own = !newcomer.empty() && member.client == newcomer;
      const std::int64_t of_client = is_own ? of_newcomer : std::max<std::int64_t>(places(member.client), 1);
      const Connection::Phase phase = pointer->phase();  // good: a connection that ends waits for mutex_ in Remove
      const bool is_serving = phase == Connection::Phase::kServes;
      if (of_client < of_newcomer || (is_serving && of_client == of_newcomer)) continue;
      const auto number = static_cast<std::int64_t>(member.number);
      const Rank rank(-of_client, phase, is_serving ? -number : number);
      if (least && *least < rank) continue;
      least = rank;
      of_least = &member;
      serves = is_serving;
    }
    if (of_least == nullptr) return false;
    of_least->is_evicted = true;
    Uncount(of_least->client);
    chosen = of_least->connection.lock();
  }
  if (!chosen) return true;  // it has just ended
  serves ? chosen->Abort() : chosen->Evict();
  return true;
}

// Connections are told before draining() is true, so that whoever has seen it gets no reply that keeps a connection
// open; and then those that were added meanwhile.
void ConnectionSet::Drain(std::chrono::milliseconds delay, std::chrono::milliseconds grace) {
  const auto close_at = std::chrono::steady_clock::now() + delay + grace;
  for (const auto& connection : Snapshot()) connection->Drain(close_at);
  {
    const std::lock_guard lock(mutex_);
    draining_ = {close_at, grace};
  }
  for (const auto& connection : Snapshot()) connection->Drain(close_at);
}

void ConnectionSet::AbortAll() {
  for (const auto& connection : Snapshot()) connection->Abort();
}

bool ConnectionSet::WaitUntilEmpty(std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  return emptied_.wait_for(lock, timeout, [this] { return connections_.empty(); });
}

}  // namespace terrace::server
