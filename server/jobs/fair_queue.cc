#include "server/jobs/fair_queue.h"

#include <algorithm>
#include <utility>

namespace terrace::server {
namespace {

using Seconds = std::chrono::duration<double>;

// A job goes before one of the next deeper level, unless that one has waited longer than this.
constexpr std::chrono::milliseconds kAgeOfLevel{100};

// A mean covers about this number of the last jobs of its kind.
constexpr unsigned kMeanSamples = 32;

// The limit of clients without jobs whose use is remembered. If there are more, all of them are forgotten.
constexpr std::size_t kMaxIdle = 4096;

JobClock::time_point KeyOf(const JobTerms& terms, JobClock::time_point now) { return now + terms.level * kAgeOfLevel; }

}  // namespace

JobTerms ShortTerms(JobClock::time_point deadline, std::uint64_t client) {
  JobTerms terms;
  terms.client = client;
  terms.deadline = deadline;
  terms.kind = 0;
  return terms;
}

JobTerms LongTerms(JobClock::time_point deadline, std::uint64_t client) {
  constexpr int kAfterTiles = 40;  // deeper than any level of tiles
  JobTerms terms = ShortTerms(deadline, client);
  terms.level = kAfterTiles;
  terms.is_long = true;
  terms.kind = 1;
  return terms;
}

FairQueue::FairQueue(unsigned threads) : threads_(threads), max_long_(std::max(threads, 2U) - 1) {}

double FairQueue::Client::UsedAt(JobClock::time_point now) const {
  double used = used_s;
  for (const JobClock::time_point begun : started) used += Seconds(now - begun).count();
  return used;
}

void FairQueue::Push(PoolJobPtr job, JobClock::time_point now) {
  Client& client = clients_[job->terms.client];
  const bool was_active = client.active();
  const Length length = LengthOf(*job);
  job->key = KeyOf(job->terms, now);
  job->number = next_number_++;
  job->expected_s = MeanOf(job->terms).seconds;
  // Allocations come first, because they may fail; Take must not fail.
  client.started.reserve(threads_);
  client.waiting[length].emplace(job->key, job);
  job->state = PoolJob::State::kWaiting;
  client.expected_s[length] += job->expected_s;
  if (!was_active) {
    client.used_s = std::max(client.used_s, now_s_);
    ++active_;
  }
  ++size_;
  if (length == kLong) ++long_waiting_;
}

bool FairQueue::HasNext(bool any_number_of_long) const {
  return size_ > long_waiting_ || (size_ > 0 && MayRunLong(any_number_of_long));
}

// Returns null if no job may run.
PoolJobPtr* FairQueue::FirstOf(Client& client, bool any_number_of_long) const {
  Waiting &shorter = client.waiting[kShort], &longer = client.waiting[kLong];
  const bool may_long = !longer.empty() && MayRunLong(any_number_of_long);
  if (shorter.empty()) return may_long ? &longer.begin()->second : nullptr;
  if (!may_long || shorter.begin()->first <= longer.begin()->first) return &shorter.begin()->second;
  return &longer.begin()->second;
}

PoolJobPtr FairQueue::Take(JobClock::time_point now, bool any_number_of_long) {
  Client* best = nullptr;
  double best_used = 0;
  for (auto& [number, client] : clients_) {
    if (FirstOf(client, any_number_of_long) == nullptr) continue;
    const double used = client.UsedAt(now);
    const bool is_first =
        best == nullptr || used < best_used || (used == best_used && client.last_turn < best->last_turn);
    if (!is_first) continue;
    best = &client;
    best_used = used;
  }
  if (best == nullptr) return nullptr;
  const PoolJobPtr job = *FirstOf(*best, any_number_of_long);
  best->started.push_back(now);
  Erase(*best, job);
  best->last_turn = next_turn_++;
  job->state = PoolJob::State::kRunning;
  job->started = now;
  if (job->terms.is_long) ++long_running_;
  return job;
}

void FairQueue::Finish(const PoolJobPtr& job, JobClock::time_point now) {
  const double seconds = std::max(Seconds(now - job->started).count(), 0.0);
  Mean& mean = means_[job->terms.kind % kKinds];
  mean.samples = std::min(mean.samples + 1, kMeanSamples);
  mean.seconds += (seconds - mean.seconds) / mean.samples;
  const auto client = clients_.find(job->terms.client);
  client->second.used_s += seconds;
  now_s_ += seconds / static_cast<double>(active_);
  std::vector<JobClock::time_point>& started = client->second.started;
  started.erase(std::ranges::find(started, job->started));
  if (job->terms.is_long) --long_running_;
  job->state = PoolJob::State::kDone;
  if (!client->second.active()) Leave(client);
}

bool FairQueue::Remove(const PoolJobPtr& job) {
  if (job->state != PoolJob::State::kWaiting) return false;
  const auto client = clients_.find(job->terms.client);
  Erase(client->second, job);
  job->state = PoolJob::State::kDone;
  if (!client->second.active()) Leave(client);
  return true;
}

PoolJobPtr FairQueue::RemoveNewestOfLargest() {
  const auto count = [](const Client& client) { return client.waiting[kShort].size() + client.waiting[kLong].size(); };
  Client* largest = nullptr;
  for (auto& [number, client] : clients_) {
    if (count(client) > (largest == nullptr ? 0 : count(*largest))) largest = &client;
  }
  if (largest == nullptr) return nullptr;
  PoolJobPtr newest;
  for (const Waiting& waiting : largest->waiting) {
    for (const auto& [key, job] : waiting) {
      if (!newest || job->number > newest->number) newest = job;
    }
  }
  Remove(newest);
  return newest;
}

Seconds FairQueue::ExpectedWait(const JobTerms& terms, JobClock::time_point now) const {
  const Length length = terms.is_long ? kLong : kShort;
  double own = 0;
  if (const auto client = clients_.find(terms.client); client != clients_.end()) {
    const Waiting& waiting = client->second.waiting[length];
    const auto end = waiting.upper_bound(KeyOf(terms, now));
    for (auto job = waiting.begin(); job != end; ++job) own += job->second->expected_s;
  }
  double ahead = own;
  const double until_its_turn = own + MeanOf(terms).seconds;
  for (const auto& [number, client] : clients_) {
    if (number != terms.client) ahead += std::min(client.expected_s[length], until_its_turn);
  }
  return Seconds(ahead / (length == kLong ? max_long_ : threads_));
}

// Removes a waiting job.
void FairQueue::Erase(Client& client, const PoolJobPtr& job) {
  const Length length = LengthOf(*job);
  Waiting& waiting = client.waiting[length];
  auto [at, end] = waiting.equal_range(job->key);
  while (at->second != job) ++at;
  waiting.erase(at);
  client.expected_s[length] = waiting.empty() ? 0 : std::max(client.expected_s[length] - job->expected_s, 0.0);
  --size_;
  if (length == kLong) --long_waiting_;
}

// The client has no jobs any more.
void FairQueue::Leave(Clients::iterator client) {
  if (client->second.used_s <= now_s_) clients_.erase(client);
  if (--active_ == 0) {
    clients_.clear();  // no client has jobs, so all start equal again
    now_s_ = 0;
  } else if (clients_.size() - active_ > kMaxIdle) {
    std::erase_if(clients_, [](const auto& known) { return !known.second.active(); });
  }
}

}  // namespace terrace::server
