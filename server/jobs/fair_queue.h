// The order in which the jobs of many clients run: fair queueing by measured time.
//
// The next job belongs to the client that has used the least worker time. Time is virtual, as in A. Demers, S. Keshav
// and S. Shenker, "Analysis and simulation of a fair queueing algorithm", SIGCOMM 1989: it advances by the time of each
// job divided by the number of clients that have jobs. A client that had no jobs starts at the current virtual time, so
// that idle time gives no advantage. Jobs cannot be interrupted, so a client's share is exact only over several of its
// jobs.
//
// Not thread-safe.
#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <vector>

namespace terrace::server {

using JobClock = std::chrono::steady_clock;

// What decides when one job runs.
struct JobTerms {
  std::uint64_t client = 0;  // whose turn it is (Request::client); 0: no client in particular
  int level = 0;         // a client's job of a lower level runs first, even if it arrives shortly after: shallow tiles
                         // cover the area of deep tiles. Deep tiles are not delayed indefinitely
  bool is_long = false;  // takes seconds; a bounded number of long jobs runs at a time
  // When the caller stops waiting for the result. A job that cannot start by then is refused.
  JobClock::time_point deadline = JobClock::time_point::max();
  std::uint64_t kind = 0;  // jobs of one kind take about the same time
};

// The terms of work for one request other than a tile. Short work has the order of a tile of level 0, long work that of
// a tile of level 40. They have kinds of their own, below kFirstTileKind.
JobTerms ShortTerms(JobClock::time_point deadline, std::uint64_t client);
JobTerms LongTerms(JobClock::time_point deadline, std::uint64_t client);
inline constexpr std::uint64_t kFirstTileKind = 2;

// A job that waits or runs. Its functions must not throw.
struct PoolJob {
  std::function<void()> run;
  std::function<void()> on_dropped;  // called instead of `run` if the job is removed for others; may be empty
  JobTerms terms;

 private:
  friend class FairQueue;
  enum class State : std::uint8_t { kNew, kWaiting, kRunning, kDone };
  State state = State::kNew;
  JobClock::time_point key{};      // orders the client's jobs
  JobClock::time_point started{};  // once it runs
  std::uint64_t number = 0;        // in the order of arrival
  double expected_s = 0;
};
using PoolJobPtr = std::shared_ptr<PoolJob>;

class FairQueue {
 public:
  // `threads`: how many run the jobs, at least 1. If there are several, all but one may run long jobs at a time; a
  // single thread runs both kinds.
  explicit FairQueue(unsigned threads);

  void Push(PoolJobPtr job, JobClock::time_point now);

  // Takes the next job, which counts as running from now on. Returns null if there is none, or only long jobs that must
  // wait for others to end. `any_number_of_long`: long jobs do not wait
  // for others.
  PoolJobPtr Take(JobClock::time_point now, bool any_number_of_long = false);
  bool HasNext(bool any_number_of_long = false) const;

  // Call this when a job from Take has ended.
  void Finish(const PoolJobPtr& job, JobClock::time_point now);

  // Returns false if the job is not waiting.
  bool Remove(const PoolJobPtr& job);

  // Removes the newest job of the client with the most waiting jobs. Returns null if no job waits.
  PoolJobPtr RemoveNewestOfLargest();

  // Expected wait of a new job: (own + the sum, over all other clients, of min(theirs, own + job)) / the number of
  // threads that may run it. `own`: the time of its client's waiting jobs that come before it; `theirs`: the
  // time of another client's waiting jobs; `job`: the time of the new job. Only jobs of the same length (is_long)
  // count, each with the mean time of its kind. Running jobs, and kinds that have never run, are not counted.
  std::chrono::duration<double> ExpectedWait(const JobTerms& terms, JobClock::time_point now) const;

  std::size_t size() const { return size_; }

 private:
  enum Length : std::uint8_t { kShort, kLong, kLengths };
  using Waiting = std::multimap<JobClock::time_point, PoolJobPtr>;
  struct Client {
    std::array<Waiting, kLengths> waiting;
    std::array<double, kLengths> expected_s{};  // of those waiting, in all
    std::vector<JobClock::time_point> started;  // of those that run
    double used_s = 0;                          // virtual time
    std::uint64_t last_turn = 0;

    bool active() const { return !started.empty() || !waiting[kShort].empty() || !waiting[kLong].empty(); }
    double UsedAt(JobClock::time_point now) const;
  };
  using Clients = std::map<std::uint64_t, Client>;
  struct Mean {
    double seconds = 0;
    unsigned samples = 0;
  };

  static constexpr std::size_t kKinds = 1024;  // kinds with equal remainders share a mean

  const Mean& MeanOf(const JobTerms& terms) const { return means_[terms.kind % kKinds]; }
  static Length LengthOf(const PoolJob& job) { return job.terms.is_long ? kLong : kShort; }
  bool MayRunLong(bool any_number_of_long) const { return any_number_of_long || long_running_ < max_long_; }
  PoolJobPtr* FirstOf(Client& client, bool any_number_of_long) const;
  void Erase(Client& client, const PoolJobPtr& job);
  void Leave(Clients::iterator client);

  const unsigned threads_, max_long_;
  Clients clients_;  // those with jobs, and those ahead of the current virtual time
  std::array<Mean, kKinds> means_{};
  double now_s_ = 0;  // virtual time
  std::size_t size_ = 0, long_waiting_ = 0;
  std::size_t active_ = 0;  // clients with jobs
  unsigned long_running_ = 0;
  std::uint64_t next_number_ = 1, next_turn_ = 1;
};

}  // namespace terrace::server
