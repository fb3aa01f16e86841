#include "server/cli/bake/bake_status.h"

#include <fmt/format.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "bake/queue/job_status.h"
#include "engine/core/plain_number.h"
#include "server/cli/bake/bake_display.h"
#include "server/cli/bake/bake_queue.h"
#include "server/cli/common/command.h"

namespace terrace::cli {
namespace {

using Json = nlohmann::ordered_json;

double Rounded(double seconds) { return std::round(seconds * 10) / 10; }

std::string StatusJson(const bake::JobStatus& status, const std::string& job) {
  Json json;
  json["job"] = job;
  json["state"] = status.state;
  json["units"] = status.units;
  json["done"] = status.done;
  json["waiting"] = status.waiting;
  json["running"] = Json::array();
  for (const auto& one : status.running) {
    json["running"].push_back({{"unit", one.unit},
                               {"worker", one.worker},
                               {"seconds", Rounded(one.seconds)},
                               {"silent_seconds", Rounded(one.silent_seconds)},
                               {"deliveries", one.deliveries}});
  }
  json["dead"] = Json::array();
  for (const auto& one : status.dead) {
    json["dead"].push_back(
        {{"unit", one.unit}, {"why", one.why}, {"deliveries", one.deliveries}, {"worker", one.worker}});
  }
  json["units_per_hour"] = Rounded(status.units_per_hour);
  json["seconds_left"] = status.seconds_left < 0 ? Json() : Json(Rounded(status.seconds_left));
  json["lease_seconds"] = status.lease_seconds;
  for (const auto& [what, value] : status.identity) json["bake"][what] = value;
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

std::string StatusText(const bake::JobStatus& status, const std::string& job) {
  std::string text = fmt::format("job {}: {}; {} of {} units done, {} running, {} waiting, {} dead", job,
                                 Shown(status.state), Grouped(status.done), Grouped(status.units),
                                 Grouped(status.running.size()), Grouped(status.waiting), Grouped(status.dead.size()));
  const auto out = std::back_inserter(text);
  if (status.units_per_hour > 0) fmt::format_to(out, "; {:.0f} units/h", status.units_per_hour);
  if (status.seconds_left >= 0) fmt::format_to(out, ", {} left", Duration(status.seconds_left));
  text += '\n';
  for (const auto& one : status.running) {
    fmt::format_to(out, "  {:<28} {:<24} {:>8}{}{}\n", Shown(one.worker), Shown(one.unit), Duration(one.seconds),
                   one.deliveries > 1 ? fmt::format(", delivery {}", one.deliveries) : "",
                   one.silent_seconds > status.lease_seconds
                       ? fmt::format(", not heard of for {}", Duration(one.silent_seconds))
                       : "");
  }
  for (const auto& one : status.dead) fmt::format_to(out, "  dead: {}: {}\n", Shown(one.unit), Shown(one.why));
  return text;
}

}  // namespace

int ShowStatus(const BakeArguments& arguments, const StatusView& view) {
  std::signal(SIGPIPE, SIG_IGN);
  const auto job = JobAddressOf(arguments);
  if (!job) return Fail(job.error());
  std::unique_ptr<redis::Connection> connection;
  bool was_connected = false;  // then --watch waits for Redis, as workers do
  const bool is_screen = view.watch && !view.json && ::isatty(STDOUT_FILENO) != 0;
  while (true) {
    if (!connection) {
      auto connected = bake::ConnectToJob(*job);
      if (!connected && was_connected && connected.error().code == ErrorCode::kUnavailable) {
        std::this_thread::sleep_for(std::chrono::seconds(2));
        continue;
      }
      if (!connected) return Fail(connected.error());
      was_connected = true;
      connection = *std::move(connected);
    }
    if (view.remove) {
      const auto removed = bake::RemoveJob(*connection, *job);
      return removed ? kExitOk : Fail(removed.error());
    }
    const auto status = bake::ReadJobStatus(*connection, *job);
    if (!status && view.watch && status.error().code == ErrorCode::kUnavailable) {  // as workers wait for Redis
      std::fprintf(stderr, "terrace: %s; trying again\n", status.error().message.c_str());
      connection.reset();
      std::this_thread::sleep_for(std::chrono::seconds(2));
      continue;
    }
    if (!status) return Fail(status.error());
    if (is_screen) fmt::print("\033[H\033[2J");
    fmt::print("{}", view.json ? StatusJson(*status, arguments.job) + "\n" : StatusText(*status, arguments.job));
    if (std::fflush(stdout) != 0) return kExitFailure;
    const bool has_ended = status->state == "finished" || status->state == "incomplete";
    if (has_ended || !view.watch) return status->state == "incomplete" ? kExitFailure : kExitOk;
    std::this_thread::sleep_for(std::chrono::seconds(2));
  }
}

}  // namespace terrace::cli
