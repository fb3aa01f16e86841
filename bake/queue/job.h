// A job in Redis: where it is, what it bakes, and the commands of its scripts.
#pragma once

#include <chrono>
#include <memory>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/result.h"
#include "redis/connection.h"

namespace terrace::bake {

// Where a job's queue is, and how to reach it.
struct JobAddress {
  redis::Address address;
  std::string ca_file = {};  // as in redis::ConnectionOptions
  std::string name;
  // For connecting, and for each call. A Redis that replies a second late is slow but works.
  std::chrono::milliseconds timeout{10'000};
  std::stop_token stop = {};  // as in redis::ConnectionOptions

  std::string Key(const std::string& what) const;
};

// kInvalidArgument: a name must have 1 to 64 letters, digits, "_", "-" and ".".
Result<void> CheckJobName(const std::string& name);

// Connects, and checks that the server has what the queue needs. Errors: as redis::Connection::Open; kInvalidArgument:
// a Redis before 6.2.
Result<std::unique_ptr<redis::Connection>> ConnectToJob(const JobAddress& job);

// What all workers of a job must agree on: names and values.
using JobIdentity = std::vector<std::pair<std::string, std::string>>;

// A script of job_scripts.h with its keys and arguments.
redis::Command ScriptCommand(const JobAddress& job, const char* script, std::vector<std::string> arguments);

// A unit that was given up.
struct DeadUnit {
  std::string unit, why, worker;
  int deliveries = 0;
};
Result<std::vector<DeadUnit>> ReadDead(redis::Connection& connection, const JobAddress& job);

// The fields of the hash of the job; empty: there is none.
Result<std::vector<std::pair<std::string, std::string>>> ReadJob(redis::Connection& connection, const JobAddress& job);
// The value of a field; empty: it has none.
std::string FieldOf(const std::vector<std::pair<std::string, std::string>>& fields, const std::string& name);

// Removes a job with all its keys from Redis. The files of the bake stay.
Result<void> RemoveJob(redis::Connection& connection, const JobAddress& job);

}  // namespace terrace::bake
