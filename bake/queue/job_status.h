// The progress of a job.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bake/queue/job.h"

namespace terrace::bake {

struct JobStatus {
  struct Running {
    std::string unit, worker;
    double seconds = 0;         // since it was taken, by Redis's clock
    double silent_seconds = 0;  // since the worker was last heard of; above a lease, another worker inherits the unit
    int deliveries = 1;
  };

  std::string state;             // "baking", "finishing", "incomplete", "finished"
  JobIdentity identity;          // what is baked
  std::uint64_t units = 0;       // of the whole bake
  std::uint64_t done = 0;        // of them; those that were there when the queue was filled are counted
  std::uint64_t waiting = 0;     // to be taken
  std::vector<Running> running;  // by worker
  std::vector<DeadUnit> dead;
  double units_per_hour = 0;  // over the last units that were done
  double seconds_left = -1;   // below 0: unknown
  double lease_seconds = 0;
};

// kNotFound: there is no such job, or Redis lost it. Errors: as redis::Connection::Call.
Result<JobStatus> ReadJobStatus(redis::Connection& connection, const JobAddress& job);

}  // namespace terrace::bake
