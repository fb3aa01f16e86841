#include "server/telemetry/access_log.h"

#include <fcntl.h>
#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <iterator>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "config/common/token_hash.h"
#include "engine/core/errno_text.h"
#include "server/telemetry/redact.h"

namespace terrace::server {
namespace {

using SystemClock = std::chrono::system_clock;

// `blanks`: also escapes blanks, because they separate the fields of a line.
std::string Escaped(std::string_view text, bool blanks = true) {
  std::string escaped;
  for (const char c : text.substr(0, kMaxLoggedBytes)) {
    if (c > (blanks ? 0x20 : 0x1f) && c < 0x7f && c != '"' && c != '\\') {
      escaped += c;
    } else {
      fmt::format_to(std::back_inserter(escaped), "\\x{:02x}", static_cast<unsigned char>(c));
    }
  }
  if (text.size() > kMaxLoggedBytes) escaped += "...";
  return escaped;
}

std::string EscapedOrDash(std::string_view text) { return text.empty() ? "-" : Escaped(text, /*blanks=*/false); }

// Bytes above ASCII become Latin-1 characters, because JSON has no bytes.
std::string Latin1(std::string_view text) {
  std::string utf8;
  for (const char c : text.substr(0, kMaxLoggedBytes)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      utf8 += c;
    } else {
      utf8 += static_cast<char>(0xc0 | byte >> 6);
      utf8 += static_cast<char>(0x80 | (byte & 0x3f));
    }
  }
  return utf8;
}

std::string TargetOf(const ReplyRecord& record) {
  // A path that matches no URL of the server may contain anything, even a token.
  const bool is_known = !record.dataset.empty() || (record.route == "viewer" && record.status < 400);
  return RedactTarget(record.target, is_known);
}

// HTTP's methods are shorter than tokens.
std::string_view MethodOf(const ReplyRecord& record) {
  return record.method.size() < config::kMinTokenBytes ? record.method : "...";
}

// The peer without its port. IPv6 addresses contain colons.
std::string_view ClientOf(const ReplyRecord& record) {
  return record.client.empty() ? record.peer.substr(0, record.peer.rfind(':')) : record.client;
}

std::string_view ProtocolOf(const ReplyRecord& record) { return record.version == 10 ? "HTTP/1.0" : "HTTP/1.1"; }

// `create`: O_CREAT or 0. Returns -1 on errors and sets errno.
int OpenToAppend(const std::filesystem::path& file, int create = O_CREAT) {
  // A pipe without a reader is refused, not waited for.
  return ::open(file.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC | O_NONBLOCK | create, 0640);
}

bool IsOfFile(config::AccessLogForm form, const std::filesystem::path& file) {
  return (form == config::AccessLogForm::kCombined || form == config::AccessLogForm::kJson) && !file.empty();
}

// An error from errno.
tl::unexpected<Error> CannotOpen(const std::filesystem::path& file) {
  if (errno == ENXIO) {
    return MakeError(ErrorCode::kUnavailable, "access log {}: is a pipe that nobody reads; start its reader first",
                     file.string());
  }
  return MakeError(ErrorCode::kUnavailable, "access log {}: {}; give a file in a folder that the server may write to",
                   file.string(), ErrorText());
}

}  // namespace

std::string FormatAccessLine(const ReplyRecord& record) {
  std::string line =
      fmt::format("{} \"{}\" {} {} B {:.3f} ms cache={} id={} peer={}", Escaped(MethodOf(record)),
                  Escaped(TargetOf(record)), record.status, record.body_bytes,
                  static_cast<double>(record.duration.count()) / 1000, record.cache, record.request_id, record.peer);
  if (!record.client.empty()) line.append(" client=").append(record.client);
  if (!record.token_name.empty()) line.append(" token=").append(Escaped(record.token_name));
  return line;
}

std::string FormatCombinedLine(const ReplyRecord& record, SystemClock::time_point now) {
  return fmt::format("{} - - [{:%d/%b/%Y:%H:%M:%S} +0000] \"{} {} {}\" {} {} \"{}\" \"{}\"", ClientOf(record),
                     fmt::gmtime(SystemClock::to_time_t(now)), Escaped(MethodOf(record)), Escaped(TargetOf(record)),
                     ProtocolOf(record), record.status, record.body_bytes, EscapedOrDash(RedactReferer(record.referer)),
                     EscapedOrDash(record.user_agent));
}

std::string FormatJsonLine(const ReplyRecord& record, SystemClock::time_point now) {
  const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(now.time_since_epoch()).count() % 1000;
  nlohmann::ordered_json line;
  line["time"] = fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(SystemClock::to_time_t(now)), ms);
  line["client"] = Latin1(ClientOf(record));
  line["method"] = Latin1(MethodOf(record));
  line["target"] = Latin1(TargetOf(record));
  line["protocol"] = ProtocolOf(record);
  line["status"] = record.status;
  line["bytes"] = record.body_bytes;
  line["seconds"] = static_cast<double>(record.duration.count()) / 1e6;
  line["route"] = record.route;
  line["dataset"] = record.dataset;
  line["cache"] = record.cache;
  line["request_id"] = record.request_id;
  line["token"] = Latin1(record.token_name);
  line["referer"] = Latin1(RedactReferer(record.referer));
  line["user_agent"] = Latin1(record.user_agent);
  return line.dump(-1, ' ', /*ensure_ascii=*/true);
}

AccessLog::AccessLog(config::AccessLogForm form, std::filesystem::path file, int descriptor)
    : form_(form),
      file_(std::move(file)),
      descriptor_(descriptor),
      writer_(file_.empty() ? nullptr : std::make_unique<LineWriter>(descriptor)) {}

AccessLog::AccessLog(AccessLog&& other) noexcept
    : form_(other.form_),
      file_(other.file_),
      descriptor_(std::exchange(other.descriptor_, -1)),
      writer_(std::move(other.writer_)) {}

AccessLog::~AccessLog() {
  if (!file_.empty() && descriptor_ >= 0) ::close(descriptor_);
}

Result<void> AccessLog::Try(config::AccessLogForm form, const std::filesystem::path& file) {
  if (!IsOfFile(form, file)) return {};
  struct stat status {};
  if (::stat(file.c_str(), &status) == 0 && S_ISFIFO(status.st_mode)) {
    // Opening and closing a pipe here would end its reader; Open checks for a reader.
    if (::access(file.c_str(), W_OK) == 0) return {};
    return CannotOpen(file);
  }
  const int descriptor = OpenToAppend(file, /*create=*/0);
  if (descriptor >= 0) {
    ::close(descriptor);
    return {};
  }
  // Open will create it, or the target of a symbolic link.
  const int why = errno;
  std::error_code ignored;
  const std::filesystem::path target = std::filesystem::read_symlink(file, ignored);
  const std::filesystem::path made = target.empty() ? file : file.parent_path() / target;
  if (why == ENOENT && ::access(made.parent_path().c_str(), W_OK | X_OK) == 0) return {};
  if (why != ENOENT) errno = why;  // else access() has said why the file cannot be created
  return CannotOpen(file);
}

Result<AccessLog> AccessLog::Open(config::AccessLogForm form, std::filesystem::path file) {
  if (!IsOfFile(form, file)) return AccessLog(form, {}, STDERR_FILENO);
  const int descriptor = OpenToAppend(file);
  if (descriptor < 0) return CannotOpen(file);
  return AccessLog(form, std::move(file), descriptor);
}

void AccessLog::Write(const ReplyRecord& record) {
  if (form_ == config::AccessLogForm::kOff) return;
  if (form_ == config::AccessLogForm::kLog) {
    if (spdlog::should_log(spdlog::level::info)) spdlog::info("{}", FormatAccessLine(record));
    return;
  }
  const auto now = SystemClock::now();
  const std::string line =
      (form_ == config::AccessLogForm::kJson ? FormatJsonLine(record, now) : FormatCombinedLine(record, now)) + '\n';
  std::uint64_t missed = 0;
  {
    const std::lock_guard lock(mutex_);
    LineWriter& writer = writer_ ? *writer_ : LineWriter::Stderr();
    if (!writer.Write(line)) return;
    missed = writer.TakeMissed();
  }
  if (missed > 0)
    spdlog::warn("{}: dropped {} lines before the last one: the file or pipe did not accept them", name(), missed);
}

void AccessLog::Reopen() {
  if (file_.empty()) return;
  const int descriptor = OpenToAppend(file_);
  if (descriptor < 0) {
    spdlog::error("access log {}: cannot be opened anew: {}", file_.string(), ErrorText());
    return;
  }
  std::uint64_t missed = 0;
  {
    const std::lock_guard lock(mutex_);
    missed = writer_->TakeMissed();
    ::close(std::exchange(descriptor_, descriptor));
    writer_ = std::make_unique<LineWriter>(descriptor);
  }
  if (missed > 0)
    spdlog::warn("{}: dropped {} lines at the end of the old file: the file or pipe did not accept them", name(),
                 missed);
}

}  // namespace terrace::server
