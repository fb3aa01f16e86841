// The threads that compute and read files, with one queue in which clients take turns (FairQueue).
//
// Jobs wait in the queue. A job is refused if it would have to wait past its deadline. If the queue is full, the newest
// job of the client with the most waiting jobs is dropped. A caller that no longer waits withdraws its job.
//
// Thread-safe. An accepted job runs, also during shutdown, unless it is withdrawn or dropped. A dropped job gets
// `on_dropped`.
#pragma once

#include <atomic>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/this_coro.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "server/asio/asio.h"
#include "server/jobs/fair_queue.h"

namespace terrace::server {

// A timer that expires at the waiter's deadline and is cancelled by Wake. It belongs to the thread of its executor.
using WaiterPtr = std::shared_ptr<asio::steady_timer>;

// Ends the wait, on the waiter's own thread. To cancel a timer before its wait has begun would have no effect, so the
// cancellation is posted to that thread, where it runs after the coroutine has suspended. From any thread; never
// throws. Null: nothing to do.
void Wake(WaiterPtr waiter);

// Runs on a worker and may block. Its stop token is stopped when nobody waits for the result.
template <typename T>
using Work = std::function<Result<T>(std::stop_token)>;

// The error of an exception that the work `name` has thrown. kOverloaded: memory is short, which is also logged.
// ThrownError: its code. kUnavailable: another exception. Never throws.
Error FailureOf(std::string_view name, const std::exception& thrown);
// kOverloaded: the job of the work `name` was dropped for others. Never throws.
Error DroppedJobError(std::string_view name);

// Runs the work and returns its result; an exception counts as FailureOf says. Never throws, which would end the
// program.
template <typename T>
Result<T> RunWork(std::string_view name, const Work<T>& work, std::stop_token stop) {
  try {
    if (stop.stop_requested()) return MakeError(ErrorCode::kCancelled, "{}: stopped before it began", name);
    return work(std::move(stop));
  } catch (const std::exception& thrown) {
    return tl::unexpected(FailureOf(name, thrown));
  }
}

class WorkerPool {
 public:
  using Now = std::function<JobClock::time_point()>;

  // `threads` 0 means as many as the machine has processors. `queue_length` bounds the jobs that wait for a thread.
  WorkerPool(unsigned threads, std::size_t queue_length, Now now = JobClock::now);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  // Runs `work` on a worker for one caller, who waits for its result. Errors: those of `work` and Submit; kCancelled:
  // the deadline passed, or the awaiting coroutine was cancelled. The coroutine must run on a single thread.
  template <typename T>
  asio::awaitable<Result<T>> Run(Work<T> work, JobTerms terms);

  // On an error the job does not run. kOverloaded: it cannot start before its deadline, or the queue is full.
  // kCancelled: its deadline has passed, or the pool accepts no more jobs. May call another job's `on_dropped`.
  Result<void> Submit(PoolJobPtr job);

  // Removes a job that still waits; it never runs. Null: does nothing.
  void Withdraw(const PoolJobPtr& job);

  // Accepts no more jobs, and requests that the work of Run and of flights stops.
  void Cancel();
  // The stop token of Cancel.
  std::stop_token cancelled() const { return cancel_.get_token(); }

  // Cancels, runs the accepted jobs and joins the threads. May be called twice; not from a job.
  void Shutdown();

  std::size_t queued() const;
  // Calls of Run that wait for their result.
  std::size_t runs() const { return runs_.load(std::memory_order_relaxed); }
  unsigned threads() const { return thread_count_; }

 private:
  template <typename T>
  struct RunState;
  template <typename T>
  class WaitGuard;

  void Serve();

  const unsigned thread_count_;
  const std::size_t queue_length_;
  const Now now_;
  std::stop_source cancel_;
  std::atomic<std::size_t> runs_{0};
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  FairQueue queue_;
  unsigned idle_ = 0;  // threads without a job
  bool shut_down_ = false;
  std::vector<std::thread> threads_;
};

// Shared by a call of Run and its job.
template <typename T>
struct WorkerPool::RunState {
  static constexpr std::string_view kName = "work for one request";

  RunState(Work<T> w, std::stop_token cancelled, WaiterPtr who)
      : work(std::move(w)), at_cancel(std::move(cancelled), [this] { stop.request_stop(); }), waiter(std::move(who)) {}

  void Finish(Result<T> result) {
    std::unique_lock lock(mutex);
    outcome = std::move(result);
    WaiterPtr who = std::exchange(waiter, nullptr);
    lock.unlock();
    Wake(std::move(who));
  }

  Work<T> work;
  std::stop_source stop;
  std::stop_callback<std::function<void()>> at_cancel;
  std::mutex mutex;                  // guards what follows
  WaiterPtr waiter;                  // null: it has left, or was woken
  std::optional<Result<T>> outcome;  // nothing: not yet
};

// The caller's part of a call of Run. Lives in the frame of Run, so that the job is given up however the coroutine
// ends.
template <typename T>
class WorkerPool::WaitGuard {
 public:
  WaitGuard(WorkerPool& pool, std::shared_ptr<RunState<T>> state, PoolJobPtr job)
      : pool_(pool), state_(std::move(state)), job_(std::move(job)) {
    pool_.runs_.fetch_add(1, std::memory_order_relaxed);
  }
  WaitGuard(const WaitGuard&) = delete;
  WaitGuard& operator=(const WaitGuard&) = delete;
  ~WaitGuard() {
    pool_.runs_.fetch_sub(1, std::memory_order_relaxed);
    std::unique_lock lock(state_->mutex);
    state_->waiter = nullptr;
    if (state_->outcome) return;
    lock.unlock();  // stopping runs the work's callbacks
    pool_.Withdraw(job_);
    state_->stop.request_stop();
  }

 private:
  WorkerPool& pool_;
  const std::shared_ptr<RunState<T>> state_;
  const PoolJobPtr job_;
};

template <typename T>
asio::awaitable<Result<T>> WorkerPool::Run(Work<T> work, JobTerms terms) {
  const auto executor = co_await asio::this_coro::executor;
  const auto waiter = std::make_shared<asio::steady_timer>(executor, terms.deadline);
  const auto state = std::make_shared<RunState<T>>(std::move(work), cancelled(), waiter);
  const auto job = std::make_shared<PoolJob>();
  job->terms = terms;
  job->run = [state] { state->Finish(RunWork(RunState<T>::kName, state->work, state->stop.get_token())); };
  job->on_dropped = [state] { state->Finish(tl::unexpected(DroppedJobError(RunState<T>::kName))); };
  const WaitGuard<T> guard(*this, state, job);
  if (Result<void> submitted = Submit(job); !submitted) co_return tl::unexpected(std::move(submitted.error()));

  boost::system::error_code ignored;  // finished, expired or cancelled; the outcome shows which
  co_await waiter->async_wait(asio::redirect_error(asio::use_awaitable, ignored));

  const std::lock_guard lock(state->mutex);
  if (state->outcome) co_return std::move(*state->outcome);
  co_return MakeError(ErrorCode::kCancelled, "{}: not ready before the request's deadline", RunState<T>::kName);
}

}  // namespace terrace::server
