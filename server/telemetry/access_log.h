// Writes one line for every reply: to the process's log, or to a separate access log in a standard format.
#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "config/config.h"
#include "engine/core/result.h"
#include "server/telemetry/line_writer.h"
#include "server/telemetry/reply_record.h"

namespace terrace::server {

inline constexpr std::size_t kMaxLoggedBytes = 512;  // of a target, a referer, a user agent or a token's name

// An entry is always one line: quotes, backslashes and bytes that are not printable ASCII are written as \xHH, in JSON
// with its escapes. Texts longer than kMaxLoggedBytes are truncated.

// GET "/maui/0/0/0.terrain" 200 4711 B 12.345 ms cache=miss id=0123456789abcdef peer=127.0.0.1:4242
// and client= and token= if they are set.
std::string FormatAccessLine(const ReplyRecord& record);

// The combined format of Apache and nginx: client - - [21/Nov/2026:06:00:06 +0000] "GET / HTTP/1.1" 200 4711 "referer"
// "agent"
std::string FormatCombinedLine(const ReplyRecord& record, std::chrono::system_clock::time_point now);

// {"time":"2026-11-21T06:00:06.123Z","client":...}
std::string FormatJsonLine(const ReplyRecord& record, std::chrono::system_clock::time_point now);

// The destination of access lines. Thread-safe.
class AccessLog {
 public:
  // `file`: for kCombined and kJson; empty: stderr. kUnavailable: the file is not writable.
  static Result<AccessLog> Open(config::AccessLogForm form, std::filesystem::path file);
  // Checks whether Open would succeed, without creating the file, which would belong to the calling user. `file` is
  // absolute.
  static Result<void> Try(config::AccessLogForm form, const std::filesystem::path& file);
  AccessLog(AccessLog&& other) noexcept;  // before the first Write
  AccessLog& operator=(AccessLog&&) = delete;
  ~AccessLog();

  void Write(const ReplyRecord& record);

  // Opens the file again after another program has renamed the old one. If that fails, logs it and continues with the
  // old one.
  void Reopen();

 private:
  AccessLog(config::AccessLogForm form, std::filesystem::path file, int descriptor);
  std::string name() const { return file_.empty() ? "stderr" : "access log " + file_.string(); }

  const config::AccessLogForm form_;
  const std::filesystem::path file_;
  std::mutex mutex_;
  int descriptor_;                      // guarded by mutex_
  std::unique_ptr<LineWriter> writer_;  // to the file; guarded by mutex_
};

}  // namespace terrace::server
