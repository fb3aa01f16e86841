#include "bake/queue/redis_queue.h"

#include <algorithm>
#include <condition_variable>
#include <random>
#include <utility>

#include "bake/queue/job_scripts.h"
#include "engine/core/parse_number.h"

namespace terrace::bake {
namespace {

using std::chrono::milliseconds;

// After a failed attempt at a unit, doubled after each further one if there are other workers; after a take that found
// no unit, and after a failed connection.
constexpr milliseconds kPauseAfterFailure{500}, kPauseWithoutUnits{500}, kPauseWithoutRedis{1000};

constexpr int kFailuresToReport = 5;  // one after the other

std::string RandomName() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

std::string Millis(milliseconds time) { return std::to_string(std::max<milliseconds::rep>(time.count(), 0)); }

}  // namespace

Result<std::unique_ptr<RedisQueue>> RedisQueue::Join(RedisQueueOptions options) {
  std::unique_ptr<RedisQueue> queue(new RedisQueue(std::move(options)));
  {
    const std::lock_guard calls(queue->calls_);
    if (auto connected = queue->Connect(); !connected) return tl::unexpected(connected.error());
    if (auto entered = queue->Enter(false); !entered) return tl::unexpected(entered.error());
    if (auto revived = queue->Revive(); !revived) return tl::unexpected(revived.error());
  }
  queue->beat_ = std::jthread([self = queue.get()](const std::stop_token& stop) { self->KeepBeating(stop); });
  return queue;
}

RedisQueue::RedisQueue(RedisQueueOptions options) : options_(std::move(options)), lease_(options_.lease) {
  for (std::size_t i = 0; i < options_.units.size(); ++i) index_.emplace(options_.units[i], i);
}

RedisQueue::~RedisQueue() { Leave(); }

bool RedisQueue::Leave() {
  beat_ = {};
  std::vector<std::size_t> left;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [unit, held] : held_) left.push_back(unit);
  }
  for (const std::size_t unit : left) Return(unit);
  {
    const std::lock_guard lock(mutex_);
    if (finish_) {
      Send(*finish_, scripts::kGiveBack, {scripts::kFinishUnit, options_.worker, "", "0", Millis(lease_)});
    }
    finish_.reset();
  }
  const std::lock_guard calls(calls_);
  const bool is_sent = Flush().has_value();
  if (is_sent && connection_) {  // without it, others wait for this worker for a lease
    (void)connection_->Call(ScriptCommand(options_.job, scripts::kLeave, {Incarnation(), options_.worker}));
  }
  const std::lock_guard lock(mutex_);
  const bool is_given_back = is_sent && outbox_.empty();  // what Redis refuses stays in it
  outbox_.clear();
  return is_given_back;
}

Result<void> RedisQueue::Connect() {
  auto connection = ConnectToJob(options_.job);
  if (!connection) return tl::unexpected(connection.error());
  connection_ = *std::move(connection);
  return {};
}

// Finds the job, or makes it. `is_emptied`: the stream is gone although the job is there.
Result<void> RedisQueue::Enter(bool is_emptied) {
  constexpr int kTries = 5;  // others may fill it at the same time
  for (int i = 0; i < kTries; ++i) {
    const auto fields = ReadJob(*connection_, options_.job);
    if (!fields) return tl::unexpected(fields.error());
    const std::string incarnation = FieldOf(*fields, "incarnation");
    if (FieldOf(*fields, "state") == "baking") {
      if (auto same = CheckIdentity(*fields); !same) return same;
      if (!is_emptied || incarnation != Incarnation()) {
        const auto number = ParseNumber<milliseconds::rep>(FieldOf(*fields, "lease_ms")).value_or(0);
        SetJob(incarnation, milliseconds(number > 0 ? number : options_.lease.count()));
        return {};
      }
    }
    const auto filled = Fill(incarnation);
    if (!filled) return tl::unexpected(filled.error());
    if (*filled) return {};
  }
  return MakeError(ErrorCode::kUnavailable, "Redis at {}: job {} is begun again and again by others; look who uses it",
                   options_.job.address.Text(), options_.job.name);
}

Result<void> RedisQueue::CheckIdentity(const std::vector<std::pair<std::string, std::string>>& fields) const {
  std::string differences;
  for (const auto& [what, value] : options_.identity) {
    const std::string theirs = FieldOf(fields, what);
    if (theirs == value) continue;
    differences += fmt::format("{}{} \"{}\", not \"{}\"", differences.empty() ? "" : "; ", what, theirs, value);
  }
  if (differences.empty()) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "Redis at {}: job {} is another bake: {}; give the same arguments, another --job, or forget that "
                   "job with 'terrace bake status --job {} --remove'",
                   options_.job.address.Text(), options_.job.name, differences, options_.job.name);
}

// False: another worker has changed the job meanwhile.
Result<bool> RedisQueue::Fill(const std::string& incarnation) {
  const std::string mine = RandomName();
  std::vector<std::pair<std::string, std::string>> fields = options_.identity;
  fields.emplace_back("incarnation", mine);
  fields.emplace_back("state", "baking");
  fields.emplace_back("lease_ms", Millis(options_.lease));
  fields.emplace_back("units", std::to_string(options_.units.size()));
  std::vector<std::string> arguments = {incarnation, std::to_string(fields.size())};
  for (auto& [name, value] : fields) {
    arguments.push_back(std::move(name));
    arguments.push_back(std::move(value));
  }
  const auto missing = options_.find_missing();
  if (!missing) return tl::unexpected(missing.error());
  for (const std::size_t unit : *missing) arguments.push_back(options_.units[unit]);
  const auto reply = connection_->Call(ScriptCommand(options_.job, scripts::kFill, std::move(arguments)));
  if (!reply) return tl::unexpected(reply.error());
  if ((*reply)[0].text() != "ok") return false;
  SetJob(mine, options_.lease);
  return true;
}

Result<void> RedisQueue::Revive() {
  const auto dead = ReadDead(*connection_, options_.job);
  if (!dead) return tl::unexpected(dead.error());
  if (dead->empty()) return {};
  std::vector<std::string> arguments = {Incarnation()};
  for (const DeadUnit& unit : *dead) {
    if (index_.contains(unit.unit)) arguments.push_back(unit.unit);
  }
  const auto reply = connection_->Call(ScriptCommand(options_.job, scripts::kRevive, std::move(arguments)));
  if (!reply) return tl::unexpected(reply.error());
  return {};
}

void RedisQueue::SetJob(const std::string& incarnation, milliseconds lease) {
  const std::lock_guard lock(mutex_);
  incarnation_ = incarnation;
  lease_ = lease;
}

std::string RedisQueue::Incarnation() const {
  const std::lock_guard lock(mutex_);
  return incarnation_;
}

void RedisQueue::NoteAway(const Error& why) {
  const Clock::time_point now = Clock::now();
  connection_ = nullptr;
  next_connect_ = now + kPauseWithoutRedis;
  if (!away_since_) {
    away_since_ = now;
    if (options_.on_message && !options_.job.stop.stop_requested()) {
      options_.on_message(fmt::format("{}; waiting for it up to {} s", why.message, options_.patience.count() / 1000));
    }
  }
  if (now - *away_since_ >= options_.patience) EndBecause(End::kLost, why);
}

void RedisQueue::NoteBack() {
  if (!away_since_) return;
  away_since_.reset();
  if (options_.on_message) options_.on_message(fmt::format("Redis at {}: is back", options_.job.address.Text()));
}

Result<redis::Reply> RedisQueue::Exchange(const redis::Command& command) {
  const auto fail = [&](const Error& why) {
    NoteAway(why);
    return tl::unexpected(why);
  };
  if (!connection_) {
    if (Clock::now() < next_connect_) return MakeError(ErrorCode::kUnavailable, "Redis is away");
    if (auto connected = Connect(); !connected) return fail(connected.error());
  }
  std::deque<Outgoing> sent;
  {
    const std::lock_guard lock(mutex_);
    sent.swap(outbox_);
  }
  std::vector<redis::Command> commands;
  for (Outgoing& one : sent) commands.push_back(std::move(one.command));
  commands.push_back(command);
  auto replies = connection_->CallAll(commands);
  {
    // What Redis refuses now, for example as a replica, is sent again, before what was added meanwhile.
    const std::lock_guard lock(mutex_);
    for (std::size_t i = sent.size(); i-- > 0;) {
      if (!replies || (*replies)[i].is_error()) {
        outbox_.push_front({std::move(commands[i]), std::move(sent[i].done)});
      } else {
        done_.erase(sent[i].done);
      }
    }
  }
  if (!replies) return fail(replies.error());
  redis::Reply last = std::move(replies->back());
  // Somebody has removed the stream or its group, or has put something else there: TakeOnce fills the queue anew.
  const auto says = [&](std::string_view what) { return last.text().find(what) != std::string_view::npos; };
  if (!last.is_error() || says("NOGROUP") || says("WRONGTYPE")) {
    NoteBack();
    return last;
  }
  return fail(connection_->Refusal(command.front(), last));
}

UnitQueue::Taken RedisQueue::Take() {
  const std::lock_guard calls(calls_);
  constexpr int kTries = 100;  // TakeOnce asks again, for example after a unit that this process holds already
  for (int i = 0; i < kTries; ++i) {
    if (const auto taken = TakeOnce()) return *taken;
  }
  return {Taken::State::kWait};
}

UnitQueue::Taken RedisQueue::WaitOrOver() {
  const std::lock_guard lock(mutex_);
  next_take_ = Clock::now() + std::min(kPauseWithoutUnits, lease_ / 4);
  return {end_ == End::kNone ? Taken::State::kWait : Taken::State::kOver};
}

// The first reason is kept.
void RedisQueue::EndBecause(End end, const Error& why) {
  const std::lock_guard lock(mutex_);
  if (end_ != End::kNone) return;
  end_ = end;
  why_ = why;
}

// Returns nothing if the caller must ask again.
std::optional<UnitQueue::Taken> RedisQueue::TakeOnce() {
  if (end() != End::kNone) return Taken{Taken::State::kOver};
  std::vector<std::string> arguments;
  {
    const std::lock_guard lock(mutex_);
    if (Clock::now() < next_take_) return Taken{Taken::State::kWait};
    arguments = {incarnation_, options_.worker, Millis(lease_), std::to_string(kMaxAttempts)};
  }
  const auto reply = Exchange(ScriptCommand(options_.job, scripts::kTake, std::move(arguments)));
  if (!reply) return WaitOrOver();
  const std::string_view what = (*reply)[0].text();
  if (what == "unit") return Accept(*reply);
  if (what == "incomplete") EndBecause(End::kIncomplete, {});
  if (what == "finished") EndBecause(End::kFinishedByOther, {});
  if (what == "wait" || end() != End::kNone) return WaitOrOver();
  // The job is gone, or its stream.
  if (const auto entered = Enter(what != "gone"); !entered) {
    if (entered.error().code == ErrorCode::kInvalidArgument) {
      EndBecause(End::kLost, entered.error());
    } else {
      NoteAway(entered.error());
    }
    return WaitOrOver();
  }
  return std::nullopt;
}

std::optional<UnitQueue::Taken> RedisQueue::Accept(const redis::ReplyView& reply) {
  const std::string name(reply[2].text());
  const int deliveries = static_cast<int>(reply[3].integer());
  const std::lock_guard lock(mutex_);
  has_others_ = reply[4].integer() > 0;
  const Held held{incarnation_, std::string(reply[1].text()), deliveries, Clock::now()};
  const bool is_finish = name == scripts::kFinishUnit;
  const auto found = index_.find(name);
  if (!is_finish && found == index_.end()) {
    Send(held, scripts::kBury, {name, options_.worker, "is no unit of this job", std::to_string(deliveries)});
    return std::nullopt;
  }
  // Not a unit in hand: this process was stopped, or Redis was away, for longer than a lease.
  if (deliveries > kMaxAttempts && (is_finish || !held_.contains(found->second))) {
    Send(held, scripts::kBury, {name, options_.worker, "", std::to_string(deliveries - 1)});
    return std::nullopt;
  }
  if (is_finish) {
    finish_ = held;
    end_ = End::kCheckNeeded;
    return Taken{Taken::State::kOver};
  }
  // A unit in hand comes again if the queue was filled anew, or if this process was stopped for longer than a lease.
  if (held_.insert_or_assign(found->second, held).second) {
    return Taken{Taken::State::kUnit, found->second, deliveries - 1};
  }
  return std::nullopt;
}

void RedisQueue::Send(const Held& held, const char* script, std::vector<std::string> arguments) {
  arguments.insert(arguments.begin(), {held.incarnation, held.id});
  outbox_.push_back({ScriptCommand(options_.job, script, std::move(arguments)), {}});
}

// The acknowledgement goes with the next command: the thread takes its next unit now.
void RedisQueue::Done(std::size_t unit) {
  const std::lock_guard lock(mutex_);
  const auto held = held_.extract(unit);
  if (held.empty()) return;
  const double seconds = std::chrono::duration<double>(Clock::now() - held.mapped().since).count();
  Send(held.mapped(), scripts::kDone, {options_.units[unit], options_.worker, fmt::format("{:.3f}", seconds)});
  outbox_.back().done = held.mapped().id;
  done_.insert(held.mapped().id);
  failures_ = 0;
  next_take_ = {};  // it may have been the last unit of the job: the next call of Take asks at once
}

void RedisQueue::Return(std::size_t unit) {
  const std::lock_guard lock(mutex_);
  const auto held = held_.extract(unit);
  if (held.empty()) return;
  Send(held.mapped(), scripts::kGiveBack,
       {options_.units[unit], options_.worker, "", std::to_string(held.mapped().deliveries - 1), Millis(lease_)});
}

bool RedisQueue::Fail(std::size_t unit, const Error& why) {
  const std::string message = why.message.empty() ? "failed" : why.message;
  std::string remark;
  {
    const std::lock_guard lock(mutex_);
    const auto held = held_.extract(unit);
    if (held.empty()) return true;
    // A worker without room or sources fails at once, and must not take all units from the others.
    constexpr int kMaxDoublings = 10;
    const milliseconds pause = kPauseAfterFailure * (1 << std::min(failures_++, kMaxDoublings));
    if (has_others_) next_take_ = Clock::now() + std::min(pause, lease_ / 8);
    if (has_others_ && failures_ == kFailuresToReport) {
      remark = fmt::format("the last {} units failed here: {}; if the other workers bake them, end this one", failures_,
                           message);
    }
    const int deliveries = held.mapped().deliveries;
    if (deliveries >= kMaxAttempts) {
      Send(held.mapped(), scripts::kBury, {options_.units[unit], options_.worker, message, std::to_string(deliveries)});
      return false;
    }
    Send(held.mapped(), scripts::kGiveBack,
         {options_.units[unit], options_.worker, message, std::to_string(deliveries),
          Millis(lease_ - kPauseAfterFailure * deliveries)});
  }
  if (!remark.empty() && options_.on_message) options_.on_message(remark);
  return true;
}

void RedisQueue::KeepBeating(const std::stop_token& stop) {
  std::mutex mutex;
  std::unique_lock lock(mutex);
  std::condition_variable_any ended;
  Clock::time_point last = Clock::now();
  while (true) {
    const Clock::time_point next = last + Lease() / 3;
    if (ended.wait_until(lock, stop, next, [&stop] { return stop.stop_requested(); })) return;
    last = Clock::now();
    Beat();
  }
}

void RedisQueue::Beat() {
  std::vector<std::string> arguments;
  {
    const std::lock_guard lock(mutex_);
    if (held_.empty() && done_.empty() && !finish_) return;
    arguments = {incarnation_, options_.worker};
    for (const auto& [unit, held] : held_) arguments.push_back(held.id);
    arguments.insert(arguments.end(), done_.begin(), done_.end());
    if (finish_) arguments.push_back(finish_->id);
  }
  // A call that takes longer is abandoned, so that the next one comes in time. Take notes whether Redis is away.
  constexpr milliseconds kMinTimeout{500};
  if (!beat_connection_ || beat_connection_->HasEnded()) {
    JobAddress job = options_.job;
    job.timeout = std::min(job.timeout, std::max(Lease() / 3, kMinTimeout));
    auto connection = ConnectToJob(job);
    if (!connection) return;
    beat_connection_ = *std::move(connection);
  }
  if (!beat_connection_->Call(ScriptCommand(options_.job, scripts::kBeat, std::move(arguments)))) {
    beat_connection_ = nullptr;
  }
}

Result<void> RedisQueue::Flush() {
  const bool is_empty = [&] {
    const std::lock_guard lock(mutex_);
    return outbox_.empty();
  }();
  if (is_empty) return {};
  if (const auto pong = Exchange({"PING"}); !pong) return tl::unexpected(pong.error());
  return {};
}

milliseconds RedisQueue::Lease() const {
  const std::lock_guard lock(mutex_);
  return lease_;
}

RedisQueue::End RedisQueue::end() const {
  const std::lock_guard lock(mutex_);
  return end_;
}

Error RedisQueue::Why() const {
  const std::lock_guard lock(mutex_);
  return why_;
}

Result<std::vector<DeadUnit>> RedisQueue::Dead() {
  const std::lock_guard calls(calls_);
  (void)Flush();
  if (!connection_) {
    if (auto connected = Connect(); !connected) return tl::unexpected(connected.error());
  }
  return ReadDead(*connection_, options_.job);
}

void RedisQueue::ReportFinished() {
  const std::lock_guard calls(calls_);
  {
    const std::lock_guard lock(mutex_);
    if (finish_) Send(*finish_, scripts::kFinished, {});
    finish_.reset();
    end_ = End::kFinishedByOther;
  }
  (void)Flush();
}

void RedisQueue::AddMissing(const std::vector<std::size_t>& units) {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> arguments;
  for (const std::size_t unit : units) arguments.push_back(options_.units[unit]);
  if (finish_) Send(*finish_, scripts::kAddMissing, std::move(arguments));
  finish_.reset();
  end_ = End::kNone;
}

}  // namespace terrace::bake
