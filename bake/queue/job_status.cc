#include "bake/queue/job_status.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdlib>
#include <map>
#include <string_view>
#include <tuple>

#include "bake/queue/job_scripts.h"

namespace terrace::bake {
namespace {

std::int64_t Int64Of(std::string_view text) {
  std::int64_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

// The words of "id worker milliseconds" in the hash of taken units.
std::array<std::string_view, 3> WordsOf(std::string_view noted) {
  const std::size_t first = std::min(noted.find(' '), noted.size());
  const std::size_t last = std::max(std::min(noted.rfind(' '), noted.size()), first);
  const auto after = [&](std::size_t at) { return noted.substr(std::min(at + 1, noted.size())); };
  return {noted.substr(0, first), after(first).substr(0, last > first ? last - first - 1 : 0), after(last)};
}

bool IsOfQueue(const std::string& field) {
  return field == "incarnation" || field == "state" || field == "lease_ms" || field == "units";
}

// Units an hour over the last ten minutes, or over all that is remembered if that is less than ten units.
double RateOf(const redis::ReplyView& done, std::int64_t now_ms) {
  constexpr std::int64_t kWindowMs = 600'000;
  constexpr std::size_t kMinUnits = 10;
  const std::size_t count = done.size();
  if (count < 2) return 0;
  const auto time_of = [&](std::size_t i) {
    const std::string_view id = done[i][0].text();
    return Int64Of(id.substr(0, id.find('-')));
  };
  std::size_t first = 0;
  while (count - first > kMinUnits && time_of(first) < now_ms - kWindowMs) ++first;
  const double elapsed_ms = static_cast<double>(std::max<std::int64_t>(now_ms - time_of(first), 1));
  return static_cast<double>(count - first - 1) / elapsed_ms * 3.6e6;
}

// The units that workers bake now, by worker and unit. `pending`: reply of XPENDING; `taken`: the hash of taken units.
std::vector<JobStatus::Running> RunningUnits(const redis::ReplyView& pending, const redis::ReplyView& taken,
                                             std::int64_t now_ms) {
  struct Pending {
    std::string worker;
    std::int64_t idle_ms = 0, deliveries = 1;
  };
  std::map<std::string, Pending, std::less<>> by_id;
  for (std::size_t i = 0; i < pending.size(); ++i) {
    const redis::ReplyView one = pending[i];
    if (one[1].text() == scripts::kNobody) continue;
    by_id.emplace(one[0].text(), Pending{std::string(one[1].text()), one[2].integer(), one[3].integer()});
  }
  std::vector<JobStatus::Running> running;
  for (std::size_t i = 0; i + 1 < taken.size(); i += 2) {
    const auto [id, worker, since] = WordsOf(taken[i + 1].text());
    const auto found = by_id.find(id);
    if (found == by_id.end()) continue;
    running.push_back({std::string(taken[i].text()), found->second.worker,
                       static_cast<double>(std::max<std::int64_t>(now_ms - Int64Of(since), 0)) / 1000,
                       static_cast<double>(found->second.idle_ms) / 1000, static_cast<int>(found->second.deliveries)});
  }
  std::ranges::sort(running, {}, [](const JobStatus::Running& one) { return std::tie(one.worker, one.unit); });
  return running;
}

}  // namespace

Result<JobStatus> ReadJobStatus(redis::Connection& connection, const JobAddress& job) {
  const auto fields = ReadJob(connection, job);
  if (!fields) return tl::unexpected(fields.error());
  if (fields->empty()) {
    return MakeError(ErrorCode::kNotFound,
                     "Redis at {}: has no job {}; either none was begun, or Redis lost it: the next worker fills it "
                     "again",
                     job.address.Text(), job.name);
  }
  const std::string units = job.Key("units");
  enum Reply : std::size_t { kTime, kQueued, kPending, kTaken, kDone, kState };
  const std::array<redis::Command, 6> commands = {{{"TIME"},
                                                   {"XLEN", units},
                                                   {"XPENDING", units, "bakers", "-", "+", "100000"},
                                                   {"HGETALL", job.Key("taken")},
                                                   {"XRANGE", job.Key("done"), "-", "+"},
                                                   {"HGET", job.Key("job"), "state"}}};
  const auto replies = connection.CallAll(commands);
  if (!replies) return tl::unexpected(replies.error());
  for (std::size_t i = 0; i < replies->size(); ++i) {
    if ((*replies)[i].is_error()) return tl::unexpected(connection.Refusal(commands[i].front(), (*replies)[i]));
  }
  auto dead = ReadDead(connection, job);
  if (!dead) return tl::unexpected(dead.error());

  JobStatus status;
  status.dead = *std::move(dead);
  status.state = (*replies)[kState].text();
  for (const auto& field : *fields) {
    if (!IsOfQueue(field.first)) status.identity.push_back(field);
  }
  status.units = static_cast<std::uint64_t>(std::max<std::int64_t>(Int64Of(FieldOf(*fields, "units")), 0));
  status.lease_seconds = static_cast<double>(Int64Of(FieldOf(*fields, "lease_ms"))) / 1000;
  const std::int64_t now_ms = Int64Of((*replies)[kTime][0].text()) * 1000 + Int64Of((*replies)[kTime][1].text()) / 1000;
  status.running = RunningUnits((*replies)[kPending], (*replies)[kTaken], now_ms);
  const bool is_finishing = std::ranges::any_of(
      status.running, [](const JobStatus::Running& one) { return one.unit == scripts::kFinishUnit; });
  const auto queued = static_cast<std::uint64_t>((*replies)[kQueued].integer()) - (is_finishing ? 1U : 0U);
  status.done = status.units - std::min<std::uint64_t>(status.units, queued + status.dead.size());
  const std::uint64_t running = status.running.size() - (is_finishing ? 1U : 0U);
  status.waiting = queued - std::min(queued, running);
  if (status.state == "baking" && is_finishing) status.state = "finishing";
  if (status.state == "baking" && queued == 0 && !status.dead.empty()) status.state = "incomplete";
  status.units_per_hour = RateOf((*replies)[kDone], now_ms);
  if (status.units_per_hour > 0 && status.state == "baking") {
    status.seconds_left = static_cast<double>(queued) / status.units_per_hour * 3600;
  }
  return status;
}

}  // namespace terrace::bake
