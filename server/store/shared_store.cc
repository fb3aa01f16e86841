#include "server/store/shared_store.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <exception>
#include <string_view>
#include <utility>

#include "tiler/store/tile_record.h"

namespace terrace::server {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kWriteTimeout{1'000}, kLastWrites{500};
constexpr milliseconds kReportAgain{60'000};
constexpr std::size_t kMaxReports = 4;  // within kReportAgain: reasons may take turns, or contain random bytes
constexpr std::size_t kBatchBytes = std::size_t{1} << 20, kBatchValues = 64;
constexpr std::size_t kChecksumBytes = 8;
constexpr std::size_t kScanReplyBytes = std::size_t{64} << 20;  // names of keys: COUNT of SCAN is only a hint
constexpr std::array<std::string_view, 3> kRefusesWrites = {"OOM", "READONLY", "MISCONF"};

bool IsTimeout(const Error& error) { return error.message.find("in time") != std::string::npos; }

// Key names are bytes; a pattern takes some of them for wildcards.
std::string PatternOf(std::string_view prefix) {
  std::string pattern;
  for (const char c : prefix) {
    if (c == '*' || c == '?' || c == '[' || c == ']' || c == '\\') pattern += '\\';
    pattern += c;
  }
  return pattern + '*';
}

std::string NameOf(std::string_view key) { return "terrace:tile:" + std::string(key); }
std::string LeaseOf(std::string_view key) { return "terrace:lease:" + std::string(key); }

}  // namespace

SharedStore::SharedStore(SharedStoreOptions options) : options_(std::move(options)), thread_([this] { Run(); }) {}

SharedStore::~SharedStore() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    changed_.notify_all();
  }
  thread_.join();
}

void SharedStore::Abandon() {
  const std::lock_guard lock(mutex_);
  abandoned_ = true;
  dropped_ += queue_.size();
  queue_.clear();
  queued_bytes_ = 0;
}

Result<SharedStore::ConnectionPtr> SharedStore::Open(milliseconds command_timeout, std::size_t max_reply_bytes) const {
  redis::ConnectionOptions options;
  options.connect_timeout = kWriteTimeout;
  options.command_timeout = command_timeout;
  options.ca_file = options_.ca_file;
  options.max_reply_bytes = max_reply_bytes;
  return redis::Connection::Open(options_.address, options);
}

SharedStore::Loan SharedStore::Borrow() {
  const std::lock_guard lock(mutex_);
  while (on_ && !idle_.empty()) {
    ConnectionPtr connection = std::move(idle_.back().connection);
    idle_.pop_back();
    if (!connection->HasEnded()) {
      borrowed_.insert(connection.get());
      return {std::move(connection), epoch_};
    }
    --open_;  // Redis closes what it has not heard of for its `timeout`: that is no failure
    changed_.notify_all();
  }
  return {nullptr, epoch_};
}

void SharedStore::GiveBack(Loan loan) {
  const std::lock_guard lock(mutex_);
  borrowed_.erase(loan.connection.get());
  if (loan.epoch == epoch_) idle_.push_back({std::move(loan.connection), Clock::now()});
}

void SharedStore::Drop(Loan loan) {
  const std::lock_guard lock(mutex_);
  borrowed_.erase(loan.connection.get());
}

// A failure of an earlier epoch has no effect: the failure that began this one caused it.
void SharedStore::SwitchOff(const Error& why, std::uint64_t epoch) {
  if (IsTimeout(why)) ++timeouts_;  // of everybody who has waited for it
  std::deque<Idle> gone;            // closed after the lock is released
  const std::lock_guard lock(mutex_);
  if (epoch != epoch_ || !on_) return;
  on_ = false;
  ++epoch_;
  ++switched_off_;
  ++errors_;
  gone.swap(idle_);
  for (const redis::Connection* const connection : borrowed_) connection->Interrupt();
  borrowed_.clear();
  open_ = 0;
  retry_at_ = Clock::now() + options_.retry_after;
  Report(why.message, /*is_off=*/true);
  changed_.notify_all();
}

// `mutex_` is held. A Redis that fails every second for one reason makes a line a minute.
void SharedStore::Report(const std::string& why, bool is_off) {
  const auto now = Clock::now();
  if (now - reported_at_ >= kReportAgain) {
    reported_.clear();
    reported_at_ = now;
  }
  if (reported_.size() >= kMaxReports || std::ranges::find(reported_, why) != reported_.end()) return;
  reported_.push_back(why);
  if (is_off) {
    spdlog::warn("shared cache: {}; it is switched off until Redis answers, tiles are built meanwhile", why);
  } else {
    spdlog::warn("shared cache: {}; values are read, but not written until writes succeed again", why);
  }
}

std::optional<redis::Reply> SharedStore::Ask(const redis::Command& command) {
  Loan loan = Borrow();
  if (!loan.connection) {
    ++skipped_;
    return std::nullopt;
  }
  const std::uint64_t epoch = loan.epoch;
  Result<std::vector<redis::Reply>> replies = loan.connection->CallAll(std::span(&command, 1));
  if (!replies) {
    Drop(std::move(loan));
    SwitchOff(replies.error(), epoch);
    return std::nullopt;
  }
  redis::Reply reply = std::move(replies->front());
  // Redis refuses to write the lease: it is full, a replica, or cannot save. Values can still be read.
  if (reply.is_error() &&
      std::ranges::any_of(kRefusesWrites, [&](std::string_view why) { return reply.text().starts_with(why); })) {
    RefuseWrites(loan.connection->Refusal(command.front(), reply).message);
    GiveBack(std::move(loan));
    return std::nullopt;
  }
  // A value of another type is wrong. After any other refusal Redis cannot be used.
  if (reply.is_error() && !reply.text().starts_with("WRONGTYPE")) {
    const Error refusal = loan.connection->Refusal(command.front(), reply);
    Drop(std::move(loan));
    SwitchOff(refusal, epoch);
    return std::nullopt;
  }
  GiveBack(std::move(loan));
  return reply;
}

std::optional<std::string> SharedStore::Find(const std::string& key) {
  // A value of any length is answered with at most one byte more than the longest that is wanted.
  const std::size_t max_bytes = options_.max_value_bytes + kChecksumBytes;
  const std::optional<redis::Reply> reply = Ask({"GETRANGE", NameOf(key), "0", std::to_string(max_bytes)});
  if (!reply) return std::nullopt;
  // GETRANGE of nothing is empty. A longer value may be of a server with another limit: it is not damaged.
  if (reply->kind() == redis::ReplyView::Kind::kText && (reply->text().empty() || reply->text().size() > max_bytes)) {
    ++misses_;
    return std::nullopt;
  }
  if (reply->kind() == redis::ReplyView::Kind::kText) {
    if (const auto value = tiler::StripChecksum(key, reply->text())) {
      ++hits_;
      return std::string(*value);
    }
  }
  Forget(key);
  return std::nullopt;
}

void SharedStore::Forget(const std::string& key) {
  ++damaged_;
  Enqueue({NameOf(key), nullptr, {}, 0});
}

void SharedStore::Keep(std::string key, std::function<std::string()> value, std::size_t charge) {
  std::string name = NameOf(key);
  Enqueue({std::move(name), std::move(value), std::move(key), charge});
}

void SharedStore::Enqueue(Job job) {
  job.charge += job.name.size() + job.key.size() + sizeof(Job);
  const std::lock_guard lock(mutex_);
  if (abandoned_ || stop_ || !on_ || queued_bytes_ + job.charge > options_.queue_bytes) {
    if (job.value) ++dropped_;
    return;
  }
  queued_bytes_ += job.charge;
  queue_.push_back(std::move(job));
  changed_.notify_all();
}

SharedStore::Lease SharedStore::Take(const std::string& key, milliseconds time) {
  const auto end = Clock::now() + time;  // not after its end in Redis
  const auto reply = Ask({"SET", LeaseOf(key), "1", "NX", "PX", std::to_string(time.count())});
  if (!reply) return Lease::kNone;
  if (reply->is_nil()) return Lease::kHeld;
  const std::lock_guard lock(mutex_);
  leases_[key] = end;
  return Lease::kTaken;
}

void SharedStore::Release(const std::string& key) {
  {
    const std::lock_guard lock(mutex_);
    const auto lease = leases_.find(key);
    if (lease == leases_.end()) return;
    const bool has_ended = Clock::now() >= lease->second;
    leases_.erase(lease);
    if (has_ended) return;
  }
  Enqueue({LeaseOf(key), nullptr, {}, 0});
}

Result<std::size_t> SharedStore::Erase(const std::string& prefix,
                                       const std::function<bool(std::string_view key)>& is_chosen,
                                       const std::stop_token& stop) {
  std::size_t erased = 0;
  {
    std::unique_lock lock(mutex_);
    const auto erase_queued = [&] {
      std::erase_if(queue_, [&](const Job& job) {
        if (!job.value || !job.key.starts_with(prefix) || !is_chosen(job.key)) return false;
        queued_bytes_ -= job.charge;
        ++erased;
        return true;
      });
    };
    erase_queued();
    // The batch on its way would be written after the scan. Later ones have no value that was queued before.
    const std::uint64_t batch = batches_;
    changed_.wait(lock, stop, [&] { return !is_writing_ || batches_ != batch; });
    erase_queued();
  }
  const auto stopped = [] { return MakeError(ErrorCode::kCancelled, "stopped while the shared cache was purged"); };
  if (stop.stop_requested()) return stopped();
  const Result<ConnectionPtr> connection = Open(kWriteTimeout, kScanReplyBytes);
  if (!connection) return tl::unexpected(connection.error());
  std::string cursor = "0";
  do {
    if (stop.stop_requested()) return stopped();
    const auto page = (*connection)->Call({"SCAN", cursor, "MATCH", PatternOf(NameOf(prefix)), "COUNT", "1000"});
    if (!page) return tl::unexpected(page.error());
    redis::Command unlink = {"UNLINK"};
    for (std::size_t i = 0; i < (*page)[1].size(); ++i) {
      const std::string_view name = (*page)[1][i].text();
      const std::size_t first = NameOf("").size();
      if (name.starts_with(NameOf(prefix)) && is_chosen(name.substr(first))) unlink.emplace_back(name);
    }
    if (unlink.size() > 1) {
      const auto gone = (*connection)->Call(unlink);
      if (!gone) return tl::unexpected(gone.error());
      erased += static_cast<std::size_t>(std::max<std::int64_t>(gone->integer(), 0));
    }
    cursor = (*page)[0].text();
  } while (cursor != "0" && !cursor.empty());
  return erased;
}

void SharedStore::Run() {
  std::unique_lock lock(mutex_);
  Clock::time_point end = Clock::time_point::max();
  while (true) {
    if (stop_) {
      if (end == Clock::time_point::max()) end = Clock::now() + kLastWrites;
      if (!on_ || queue_.empty() || write_at_ >= end || Clock::now() >= end) break;
    }
    const bool connects = !stop_ && open_ < options_.readers && Clock::now() >= retry_at_;
    const bool writes = on_ && !queue_.empty() && Clock::now() >= write_at_;
    const bool tests = !stop_ && Clock::now() >= NextTest();
    if (!connects && !writes && !tests) {
      Clock::time_point next = std::min(Clock::now() + kReportAgain, NextTest());
      if (open_ < options_.readers) next = std::min(next, retry_at_);
      if (on_ && !queue_.empty()) next = std::min(next, write_at_);
      changed_.wait_until(lock, std::min(next, end));
      continue;
    }
    is_writing_ = writes;
    lock.unlock();
    if (tests) Test();
    if (connects) Connect();
    if (writes) Write();
    lock.lock();
    if (std::exchange(is_writing_, false)) {
      ++batches_;
      changed_.notify_all();
    }
  }
  dropped_ += queue_.size();
}

// Opens one connection for look-ups. If it answers in time, the store is switched on.
void SharedStore::Connect() {
  std::uint64_t epoch = 0;
  {
    const std::lock_guard lock(mutex_);
    epoch = epoch_;
  }
  Result<ConnectionPtr> connection = Open(options_.timeout, MaxReply());
  Result<redis::Reply> pong = connection ? (*connection)->Call({"PING"}) : tl::unexpected(connection.error());
  const std::lock_guard lock(mutex_);
  if (!pong) {
    retry_at_ = Clock::now() + options_.retry_after;
    if (!on_) Report(pong.error().message, /*is_off=*/true);
    return;  // those that are open may go on
  }
  if (epoch != epoch_) return;
  if (!on_) {
    on_ = true;
    writer_ = nullptr;  // of the time before
    const auto now = Clock::now();
    if (answered_at_ == Clock::time_point{} || now - answered_at_ >= kReportAgain) {
      spdlog::info("shared cache: {} answers", options_.address.Text());
      answered_at_ = now;
    }
  }
  ++open_;
  idle_.push_back({*std::move(connection), Clock::now()});
}

// `mutex_` is held.
SharedStore::Clock::time_point SharedStore::NextTest() const {
  return idle_.empty() ? Clock::time_point::max() : idle_.front().since + options_.test_after;
}

// Tests the connection that was not used for longest. A fire wall or a failover may have dropped it silently.
void SharedStore::Test() {
  Loan loan;
  {
    const std::lock_guard lock(mutex_);
    if (idle_.empty()) return;
    loan = {std::move(idle_.front().connection), epoch_};
    idle_.pop_front();
    borrowed_.insert(loan.connection.get());
  }
  const std::uint64_t epoch = loan.epoch;
  if (loan.connection->HasEnded()) {
    Drop(std::move(loan));
    const std::lock_guard lock(mutex_);
    if (epoch == epoch_) --open_;
    return;
  }
  const Result<redis::Reply> pong = loan.connection->Call({"PING"});
  if (pong) return GiveBack(std::move(loan));
  Drop(std::move(loan));
  SwitchOff(pong.error(), epoch);
}

void SharedStore::RefuseWrites(const std::string& why) {
  const std::lock_guard lock(mutex_);
  write_at_ = Clock::now() + options_.retry_after;
  Report(why, /*is_off=*/false);
}

redis::Command SharedStore::CommandOf(const Job& job) const {
  if (!job.value) return {"UNLINK", job.name};
  redis::Command command = {"SET", job.name, tiler::AddChecksum(job.key, job.value())};
  if (options_.ttl.count() > 0) command.insert(command.end(), {"EX", std::to_string(options_.ttl.count())});
  return command;
}

// One batch, in one round trip.
void SharedStore::Write() {
  std::list<Job> jobs;
  std::uint64_t epoch = 0;
  {
    const std::lock_guard lock(mutex_);
    epoch = epoch_;
    std::size_t bytes = 0;
    while (!queue_.empty() && jobs.size() < kBatchValues && bytes < kBatchBytes) {
      bytes += queue_.front().charge;
      jobs.splice(jobs.end(), queue_, queue_.begin());
    }
    queued_bytes_ -= bytes;
  }
  const auto values =
      static_cast<std::uint64_t>(std::ranges::count_if(jobs, [](const Job& job) { return !!job.value; }));
  // A fire wall drops idle connections silently. A write there would wait for its time-out, and interrupt readers.
  if (!writer_ || writer_->HasEnded() || Clock::now() - written_at_ >= options_.test_after) {
    Result<ConnectionPtr> opened = Open(kWriteTimeout, MaxReply());
    if (!opened) {
      dropped_ += values;
      return SwitchOff(opened.error(), epoch);
    }
    writer_ = *std::move(opened);
  }
  std::vector<redis::Command> commands;
  try {
    for (const Job& job : jobs) commands.push_back(CommandOf(job));
  } catch (const std::exception& exception) {  // std::bad_alloc
    dropped_ += values;
    ++errors_;
    return RefuseWrites(fmt::format("values cannot be encoded: {}", exception.what()));
  }
  const Result<std::vector<redis::Reply>> replies = writer_->CallAll(commands);
  written_at_ = Clock::now();
  if (!replies) {
    dropped_ += values;
    return SwitchOff(replies.error(), epoch);
  }
  std::string refused;
  for (std::size_t i = 0; i < commands.size(); ++i) {
    const bool is_value = commands[i].front() == "SET";
    if ((*replies)[i].is_error()) {
      ++errors_;
      if (is_value) ++dropped_;
      refused = writer_->Refusal(commands[i].front(), (*replies)[i]).message;
    } else if (is_value) {
      ++written_;
    }
  }
  if (!refused.empty()) RefuseWrites(refused);
}

tiler::StoreStats SharedStore::stats() const {
  tiler::StoreStats stats;
  stats.hits = hits_;
  stats.misses = misses_;
  stats.errors = errors_;
  stats.damaged = damaged_;
  stats.written = written_;
  stats.dropped = dropped_;
  stats.timeouts = timeouts_;
  stats.skipped = skipped_;
  stats.switched_off = switched_off_;
  const std::lock_guard lock(mutex_);
  stats.on = on_ && Clock::now() >= write_at_;
  return stats;
}

}  // namespace terrace::server
