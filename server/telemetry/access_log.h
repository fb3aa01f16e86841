// One line for every reply: in the log, or in a log of its own in a form that other programs read.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "config/config.h"
#include "engine/core/result.h"
#include "server/telemetry/line_writer.h"

namespace terrace::server {

// What is told about a reply when its last byte was handed to the kernel. Valid during the call only; what the client
// sent may hold anything.
struct ReplyRecord {
  std::string_view method;
  std::string_view target;  // as sent by the client; the log has what ShownTarget says of it
  unsigned version = 11;    // of HTTP: 10 or 11
  int status = 0;           // 499: the client left before there was a reply
  std::size_t body_bytes = 0;
  std::chrono::microseconds duration{0};  // from the end of the request's head
  std::string_view route;                 // a literal
  std::string_view dataset;               // one that exists, or empty
  std::string_view cache;                 // hit, miss, join or -
  std::string_view request_id;
  std::string_view peer;                 // address and port
  std::string_view client;               // whom a trusted proxy speaks for; empty where the peer is the client
  std::string_view token_name;           // empty: none
  std::string_view referer, user_agent;  // as sent; the log has what ShownReferer says
};

inline constexpr std::size_t kMaxLoggedTargetBytes = 512;

// In all forms quotes, backslashes and whatever is not printable ASCII appear as \xHH (in JSON as \u00HH), so that a
// line is one line; what is longer than kMaxLoggedTargetBytes is cut.

// GET "/maui/0/0/0.terrain" 200 4711 B 12.345 ms cache=miss id=0123456789abcdef peer=127.0.0.1:4242
// and client= and token= where there are such.
std::string FormatAccessLine(const ReplyRecord& record);

// As Apache and nginx write it: client - - [21/Nov/2026:06:00:06 +0000] "GET / HTTP/1.1" 200 4711 "referer" "agent"
std::string FormatCombinedLine(const ReplyRecord& record, std::chrono::system_clock::time_point now);

// {"time":"2026-11-21T06:00:06.123Z","client":...}
std::string FormatJsonLine(const ReplyRecord& record, std::chrono::system_clock::time_point now);

// Where requests are told of. Thread-safe.
class AccessLog {
 public:
  // `file`: of kCombined and kJson; empty: stderr. kUnavailable: it cannot be written.
  static Result<AccessLog> Open(config::AccessLogForm form, std::filesystem::path file);
  // Whether Open could, without making the file, which would belong to whoever asks. `file` is absolute.
  static Result<void> Try(config::AccessLogForm form, const std::filesystem::path& file);
  AccessLog(AccessLog&& other) noexcept;  // before the first Write
  AccessLog& operator=(AccessLog&&) = delete;
  ~AccessLog();

  void Write(const ReplyRecord& record);

  // The file of that name as it is now, after another program has moved the old one away. The old one stays in use
  // where that fails, which the log tells.
  void Reopen();

 private:
  AccessLog(config::AccessLogForm form, std::filesystem::path file, int descriptor);
  std::string name() const { return file_.empty() ? "stderr" : "access log " + file_.string(); }

  const config::AccessLogForm form_;
  const std::filesystem::path file_;
  std::mutex mutex_;
  int descriptor_;                      // guarded by mutex_
  std::unique_ptr<LineWriter> writer_;  // to the file; likewise
};

}  // namespace terrace::server
