// The queue of a job that many bakers share, in Redis. docs/baking.md describes it for users.
//
// A duplicate worker writes the same bytes, so a lease only saves work. Redis may be lost at any time: what is baked
// lies in the place, and the queue is filled again with what is missing there.
#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <string>
#include <thread>
#include <unordered_map>
#include <vector>

#include "bake/queue/job.h"
#include "bake/queue/unit_queue.h"

namespace terrace::bake {

struct RedisQueueOptions {
  JobAddress job;
  JobIdentity identity;
  std::string worker;              // the name of this process among the workers of the job
  std::vector<std::string> units;  // the names of the units of the plan, by index
  // The indexes of the units that have no file with the right key. Called whenever the queue is filled.
  std::function<Result<std::vector<std::size_t>>()> find_missing;
  // A unit whose worker was silent for so long goes to another worker. The worker that fills the queue sets it for all.
  std::chrono::milliseconds lease{30'000};
  std::chrono::milliseconds patience{600'000};  // how long an unreachable Redis is waited for
  // Receives a message when Redis becomes unreachable, and when it is back. May be empty. Called by any thread.
  std::function<void(const std::string&)> on_message = {};
};

class RedisQueue : public UnitQueue {
 public:
  // Joins the job, or begins it: whoever comes first fills the queue. A job that ended with units that were given up
  // tries them again. kInvalidArgument: the job bakes something else; the message says what differs. Errors of
  // ConnectToJob.
  static Result<std::unique_ptr<RedisQueue>> Join(RedisQueueOptions options);
  // Leaves.
  ~RedisQueue() override;

  Taken Take() override;
  void Done(std::size_t unit) override;
  void Return(std::size_t unit) override;
  bool Fail(std::size_t unit, const Error& why) override;

  // Why Take returned kOver.
  enum class End {
    kNone,             // it has not
    kCheckNeeded,      // all are done, and this worker is to check them: then call ReportFinished or AddMissing
    kFinishedByOther,  // another worker has done that
    kIncomplete,       // units were given up: Dead
    kLost,             // Redis was unreachable for too long, or the job is another one now: Why
  };
  End end() const;
  Error Why() const;
  // The units that were given up.
  Result<std::vector<DeadUnit>> Dead();
  // Gives back the units that were not done, and makes no call afterwards. False: Redis does not reply, so that others
  // get them when their lease has ended. Called when no other call is under way.
  bool Leave();
  // After kCheckNeeded: the manifest is written.
  void ReportFinished();
  // After kCheckNeeded: these units are absent although they were done. The job continues with them.
  void AddMissing(const std::vector<std::size_t>& units);

 private:
  using Clock = std::chrono::steady_clock;
  struct Held {
    std::string incarnation, id;
    int deliveries = 1;
    Clock::time_point since;
  };

  explicit RedisQueue(RedisQueueOptions options);
  // `calls_` is held by the caller of these, `mutex_` is not.
  Result<void> Enter(bool is_emptied);
  Result<void> CheckIdentity(const std::vector<std::pair<std::string, std::string>>& fields) const;
  Result<bool> Fill(const std::string& incarnation);
  Result<void> Revive();
  Result<void> Connect();
  // Sends the outbox, then `command`. Notes when Redis is away.
  Result<redis::Reply> Exchange(const redis::Command& command);
  void NoteAway(const Error& why);
  void NoteBack();
  std::optional<Taken> TakeOnce();
  std::optional<Taken> Accept(const redis::ReplyView& reply);
  Taken WaitOrOver();
  void EndBecause(End end, const Error& why);
  Result<void> Flush();
  // Takes over the job's values in Redis.
  void SetJob(const std::string& incarnation, std::chrono::milliseconds lease);
  std::string Incarnation() const;
  std::chrono::milliseconds Lease() const;
  // `mutex_` is held. Puts a script about a unit into the outbox: with its incarnation and id, and the other arguments.
  void Send(const Held& held, const char* script, std::vector<std::string> arguments);

  // Of the heartbeat's thread. It has a connection of its own, so that a late reply of Redis, or a long search for
  // missing units, does not cost the leases.
  void KeepBeating(const std::stop_token& stop);
  void Beat();

  const RedisQueueOptions options_;
  std::unordered_map<std::string, std::size_t> index_;  // of options_.units, by name

  std::mutex calls_;  // held while Redis is waited for; taken before mutex_
  std::unique_ptr<redis::Connection> connection_;
  Clock::time_point next_connect_{};
  std::optional<Clock::time_point> away_since_;

  mutable std::mutex mutex_;       // of what follows; never held while Redis is waited for
  Clock::time_point next_take_{};  // Take does not ask before
  int failures_ = 0;               // of this worker since a unit was done
  bool has_others_ = false;        // other workers were heard of when the last unit was taken
  std::string incarnation_;
  std::chrono::milliseconds lease_;
  std::map<std::size_t, Held> held_;
  std::optional<Held> finish_;
  struct Outgoing {
    redis::Command command;
    std::string done;  // the id that it acknowledges; empty: none
  };
  std::deque<Outgoing> outbox_;  // to be sent before the next command
  std::set<std::string> done_;   // ids that are not acknowledged yet: the heartbeat renews their leases until then
  End end_ = End::kNone;
  Error why_;

  std::unique_ptr<redis::Connection> beat_connection_;
  std::jthread beat_;
};

}  // namespace terrace::bake
