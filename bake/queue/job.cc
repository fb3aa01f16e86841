#include "bake/queue/job.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <string_view>

#include "bake/queue/job_scripts.h"

namespace terrace::bake {
namespace {

constexpr std::array<const char*, 8> kKeys = {"job", "units", "dead", "taken", "done", "errors", "failed", "workers"};

int NumberOf(std::string_view text) {
  int number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

// XAUTOCLAIM came with 6.2.
Result<void> CheckVersion(redis::Connection& connection, const JobAddress& job) {
  const auto info = connection.Call({"INFO", "server"});
  if (!info) return tl::unexpected(info.error());
  constexpr std::string_view kField = "redis_version:";
  const std::string_view text = info->text();
  const std::size_t at = text.find(kField);
  const std::string_view version =
      at == std::string_view::npos
          ? "unknown"
          : text.substr(at + kField.size(), text.find_first_of("\r\n", at) - at - kField.size());
  const std::size_t dot = std::min(version.find('.'), version.size() - 1);
  const int major = NumberOf(version), minor = NumberOf(version.substr(dot + 1));
  if (major > 6 || (major == 6 && minor >= 2)) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "Redis at {}: has version {}, and the queue needs 6.2 or later (XAUTOCLAIM); take a newer Redis, or "
                   "bake with --shard",
                   job.address.Text(), version);
}

}  // namespace

std::string JobAddress::Key(const std::string& what) const { return fmt::format("terrace:{{{}}}:{}", name, what); }

Result<void> CheckJobName(const std::string& name) {
  constexpr std::size_t kMaxSize = 64;
  const bool is_fine = !name.empty() && name.size() <= kMaxSize && std::ranges::all_of(name, [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
           c == '.';
  });
  if (is_fine && name.find("-of-") == std::string::npos) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "--job \"{}\": must have 1 to {} letters, digits, \"_\", \"-\" and \".\", and no \"-of-\"", name,
                   kMaxSize);
}

Result<std::unique_ptr<redis::Connection>> ConnectToJob(const JobAddress& job) {
  redis::ConnectionOptions options;
  options.connect_timeout = options.command_timeout = job.timeout;
  options.ca_file = job.ca_file;
  options.stop = job.stop;
  auto connection = redis::Connection::Open(job.address, options);
  if (!connection) return connection;
  if (auto checked = CheckVersion(**connection, job); !checked) return tl::unexpected(checked.error());
  return connection;
}

redis::Command ScriptCommand(const JobAddress& job, const char* script, std::vector<std::string> arguments) {
  redis::Command command = {"EVAL", std::string(scripts::kPrelude) + script, std::to_string(kKeys.size())};
  for (const char* const key : kKeys) command.push_back(job.Key(key));
  std::ranges::move(arguments, std::back_inserter(command));
  return command;
}

Result<std::vector<DeadUnit>> ReadDead(redis::Connection& connection, const JobAddress& job) {
  const auto reply = connection.Call({"XRANGE", job.Key("dead"), "-", "+"});
  if (!reply) return tl::unexpected(reply.error());
  std::vector<DeadUnit> dead;
  for (std::size_t i = 0; i < reply->size(); ++i) {
    const redis::ReplyView fields = (*reply)[i][1];
    dead.push_back({std::string(fields.Field("unit").text()), std::string(fields.Field("why").text()),
                    std::string(fields.Field("worker").text()), NumberOf(fields.Field("deliveries").text())});
  }
  return dead;
}

Result<std::vector<std::pair<std::string, std::string>>> ReadJob(redis::Connection& connection, const JobAddress& job) {
  const auto reply = connection.Call({"HGETALL", job.Key("job")});
  if (!reply) return tl::unexpected(reply.error());
  std::vector<std::pair<std::string, std::string>> fields;
  for (std::size_t i = 0; i + 1 < reply->size(); i += 2) {
    fields.emplace_back((*reply)[i].text(), (*reply)[i + 1].text());
  }
  return fields;
}

std::string FieldOf(const std::vector<std::pair<std::string, std::string>>& fields, const std::string& name) {
  const auto found = std::ranges::find(fields, name, &std::pair<std::string, std::string>::first);
  return found == fields.end() ? std::string() : found->second;
}

Result<void> RemoveJob(redis::Connection& connection, const JobAddress& job) {
  redis::Command command = {"DEL"};
  for (const char* const key : kKeys) command.push_back(job.Key(key));
  const auto reply = connection.Call(command);
  if (!reply) return tl::unexpected(reply.error());
  if (reply->integer() > 0) return {};
  return MakeError(ErrorCode::kNotFound, "Redis at {}: has no job {}", job.address.Text(), job.name);
}

}  // namespace terrace::bake
