// A baker that takes its units from the queue of a job.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "bake/baker.h"
#include "bake/place.h"
#include "bake/queue/job.h"
#include "engine/core/result.h"
#include "server/cli/bake/bake_arguments.h"

namespace terrace::cli {

// How to reach the job, with its credentials. kInvalidArgument: the flags are wrong; the message has no secret.
Result<bake::JobAddress> JobAddressOf(const BakeArguments& arguments);

// What Redis says of a unit or a worker, for people: anybody may have written it. At most 200 bytes, without control
// characters.
std::string Shown(const std::string& text);

// A new name at each call: host, process and a random number, because processes of several containers may have equal
// numbers.
std::string WorkerName();

// Whether the bake in the place is finished. If so, prints that.
bool IsFinished(const std::string& place, const std::vector<bake::Target>& targets);

struct QueuedBake {
  const BakeArguments& arguments;
  const tiler::TilePipeline& pipeline;
  const std::vector<bake::Target>& targets;
  const bake::UnitPlan& plan;
  const bake::BakeOptions& options;
  std::string place, worker;
  const bake::BakeIdentity& identity;
  // Writes the manifests from the reports of all units.
  std::function<Result<void>(const std::vector<bake::UnitReport>&)> finish;
};

// Bakes until the job has ended. `reports`: of the units that this process took. Returns the exit code: 0 the archive
// is complete; 1 the job is incomplete or Redis is lost; 2 Redis or the job is not what the arguments say. Prints why.
int BakeFromQueue(const QueuedBake& bake, bake::Counters& counters, std::vector<bake::UnitReport>& reports);

}  // namespace terrace::cli
