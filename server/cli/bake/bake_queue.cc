#include "server/cli/bake/bake_queue.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <iterator>
#include <memory>
#include <random>
#include <set>
#include <string>
#include <utility>

#include "bake/find_missing.h"
#include "bake/place_files.h"
#include "bake/queue/redis_queue.h"
#include "engine/gdal/source_policy.h"
#include "server/cli/bake/bake_display.h"
#include "server/cli/common/command.h"
#include "server/store/password_file.h"
#include "tiler/encoder_version.h"

namespace terrace::cli {
namespace {

constexpr const char* kPasswordVariable = "TERRACE_QUEUE_PASSWORD";

Result<std::string> PasswordOf(const BakeArguments& arguments) {
  if (arguments.queue_password_file.empty()) {
    const char* const password = std::getenv(kPasswordVariable);
    return std::string(password == nullptr ? "" : password);
  }
  auto password = server::ReadPassword(arguments.queue_password_file);
  if (password) return password;
  return MakeError(ErrorCode::kInvalidArgument, "--queue-password-file: {}", password.error().message);
}

// "terrain+glb/7-12-34": units of other formats have the same names.
std::string NameInQueue(const bake::UnitPlan::Entry& entry, const std::vector<bake::Target>& targets) {
  std::string name;
  for (const std::size_t target : entry.targets) {
    name += (name.empty() ? "" : "+") + archive::FolderOf(targets[target].manifest.kind.format);
  }
  return name + "/" + entry.unit.name;
}

bool HasAllManifests(const std::string& place, const std::vector<bake::Target>& targets) {
  std::vector<archive::Manifest> manifests;
  std::ranges::transform(targets, std::back_inserter(manifests), &bake::Target::manifest);
  return bake::TidyIfFinished(place, manifests);
}

void PrintMessage(const std::string& message) { std::fprintf(stderr, "terrace: %s\n", message.c_str()); }

Result<std::unique_ptr<bake::RedisQueue>> Join(const QueuedBake& bake) {
  auto job = JobAddressOf(bake.arguments);
  if (!job) return tl::unexpected(job.error());
  const auto place_id = bake::PlaceId(bake.place);
  if (!place_id) return tl::unexpected(place_id.error());
  const tiler::Dataset& dataset = bake.pipeline.datasets().front();
  const archive::Manifest& manifest = bake.targets.front().manifest;
  bake::RedisQueueOptions options;
  options.job = *std::move(job);
  options.job.stop = bake.options.stop;
  for (const auto& [what, value] : bake.identity.fields) options.identity.emplace_back(what, value);
  options.identity.emplace_back("program", manifest.product);
  options.identity.emplace_back("encoders and libraries", manifest.encoder);
  options.identity.emplace_back("sources (version)", tiler::VersionText(dataset.generation));
  options.identity.emplace_back("place (bake-place.id)", *place_id);
  options.worker = bake.worker;
  for (const bake::UnitPlan::Entry& entry : bake.plan.units) options.units.push_back(NameInQueue(entry, bake.targets));
  options.find_missing = [&bake, &dataset]() -> Result<std::vector<std::size_t>> {
    // The job ended after this worker had looked. It must not begin anew, with a number of the place that others do not
    // have.
    if (HasAllManifests(bake.place, bake.targets)) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: is complete already", bake.place);
    }
    return bake::FindMissing(dataset, bake.targets, bake.plan, bake.options.stop);
  };
  options.lease = std::chrono::milliseconds(static_cast<std::int64_t>(bake.arguments.lease * 1000));
  options.on_message = PrintMessage;
  return bake::RedisQueue::Join(std::move(options));
}

// Checks all files, as --finish does. Returns an exit code, or nothing: the job goes on.
std::optional<int> FinishJob(const QueuedBake& bake, bake::RedisQueue& queue) {
  bake::BakeOptions options = bake.options;
  options.only_verify = true;
  options.on_unit = {};
  bake::Counters counters;
  const std::vector<bake::UnitReport> all = bake::Bake(bake.pipeline, bake.targets, bake.plan, options, counters);
  if (bake.options.stop.stop_requested()) return kExitFailure;
  std::set<std::pair<std::size_t, std::string>> kept;  // target and name
  for (const bake::UnitReport& report : all) {
    if (report.outcome == bake::UnitOutcome::kKept) kept.emplace(report.target, report.entry.name);
  }
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < bake.plan.units.size(); ++i) {
    const bake::UnitPlan::Entry& entry = bake.plan.units[i];
    const auto is_kept = [&](std::size_t target) { return kept.contains({target, entry.unit.name}); };
    if (!std::ranges::all_of(entry.targets, is_kept)) missing.push_back(i);
  }
  if (!missing.empty()) {
    PrintMessage(
        fmt::format("{} units were done but are not there, or are damaged; they are baked again", missing.size()));
    queue.AddMissing(missing);
    return std::nullopt;
  }
  if (const auto finished = bake.finish(all); !finished) return Fail(finished.error());
  queue.ReportFinished();
  return kExitOk;
}

int ListDead(const QueuedBake& bake, bake::RedisQueue& queue) {
  const auto dead = queue.Dead();
  if (!dead) return Fail(dead.error());
  for (const bake::DeadUnit& unit : *dead) {
    PrintMessage(fmt::format("unit {} failed: {} (handed out {} times, last to {})", Shown(unit.unit), Shown(unit.why),
                             unit.deliveries, Shown(unit.worker)));
  }
  PrintMessage(
      fmt::format("job {} is incomplete: {} of {} units failed, the others are done, and there is no manifest; "
                  "run the same command again to go on",
                  bake.arguments.job, dead->size(), bake.plan.units.size()));
  return kExitFailure;
}

}  // namespace

Result<bake::JobAddress> JobAddressOf(const BakeArguments& arguments) {
  bake::JobAddress job;
  if (auto checked = bake::CheckJobName(arguments.job); !checked) return tl::unexpected(checked.error());
  auto address = redis::ParseAddress(arguments.queue);
  if (!address) return MakeError(ErrorCode::kInvalidArgument, "--queue: {}", address.error().message);
  auto password = PasswordOf(arguments);
  if (!password) return tl::unexpected(password.error());
  job.address = *std::move(address);
  if (!password->empty()) job.address.password = *std::move(password);
  job.ca_file = arguments.queue_ca;
  job.name = arguments.job;
  job.timeout = std::chrono::milliseconds(static_cast<std::int64_t>(arguments.queue_timeout * 1000));
  return job;
}

std::string Shown(const std::string& text) {
  constexpr std::size_t kMaxBytes = 200;
  return dem::EscapeControls(text.size() <= kMaxBytes ? text : text.substr(0, kMaxBytes) + "...");
}

std::string WorkerName() {
  std::string name = bake::HostName();
  std::ranges::replace_if(
      name, [](char c) { return c == '/' || c == ' '; }, '_');
  return fmt::format("{}-{}-{:04x}", name, ::getpid(), std::random_device()() & 0xffffU);
}

bool IsFinished(const std::string& place, const std::vector<bake::Target>& targets) {
  if (!HasAllManifests(place, targets)) return false;
  PrintMessage(fmt::format("{}: is complete already; --finish instead of --queue checks every file", place));
  return true;
}

int BakeFromQueue(const QueuedBake& bake, bake::Counters& counters, std::vector<bake::UnitReport>& reports) {
  const auto queue = Join(bake);
  if (!queue) {
    if (IsFinished(bake.place, bake.targets)) return kExitOk;
    bake::RemoveNotesIfEmpty(bake.place, bake::LockOfWorker(bake.worker, bake.arguments.job));
    return Fail(queue.error());
  }
  while (true) {
    std::vector<bake::UnitReport> taken;
    {
      const BakeDisplay display(bake.pipeline.datasets().front().name, bake.plan.tiles, bake.plan.files, counters);
      taken = bake::Bake(bake.pipeline, bake.targets, bake.plan, **queue, bake.options, counters);
    }
    std::ranges::move(taken, std::back_inserter(reports));
    if (bake.options.stop.stop_requested()) {
      PrintMessage((*queue)->Leave()
                       ? "stopped: other workers have its units now; run the same command again to go on"
                       : "stopped: Redis does not reply, so other workers get its units when their lease has ended; "
                         "run the same command again to go on");
      return kExitFailure;
    }
    switch ((*queue)->end()) {
      case bake::RedisQueue::End::kCheckNeeded:
        if (const auto code = FinishJob(bake, **queue)) return *code;
        break;
      case bake::RedisQueue::End::kFinishedByOther:
        return kExitOk;
      case bake::RedisQueue::End::kIncomplete:
        return ListDead(bake, **queue);
      default:
        if (IsFinished(bake.place, bake.targets)) return kExitOk;
        return Fail((*queue)->Why());
    }
  }
}

}  // namespace terrace::cli
