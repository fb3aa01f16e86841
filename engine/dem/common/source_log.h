// Log lines about the sources of a dataset, of which there may be tens of thousands: of each kind the first few are
// written, the others are counted.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace terrace::dem {

// Counts the lines of threads that have it in use (Use). Thread-safe.
class SourceLog {
 public:
  enum class Level : std::uint8_t { kDebug, kInfo, kWarn };
  static constexpr std::size_t kMaxLines = 5;  // of a kind

  SourceLog() = default;
  // Writes how many lines of each kind were left out.
  ~SourceLog();
  SourceLog(const SourceLog&) = delete;
  SourceLog& operator=(const SourceLog&) = delete;

  // For the lines of this thread, until the end of the scope.
  class Use {
   public:
    explicit Use(SourceLog& log);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    SourceLog* const before_;
  };

  static bool IsWritten(Level level);  // by the log's own level
  // "PATH: TEXT". Without a log in use every line is written.
  static void Write(Level level, std::string_view kind, const std::string& path, const std::string& text);

 private:
  struct Lines {
    std::size_t count = 0;
    std::string example;  // the last text that was written
  };
  bool Admits(Level level, std::string_view kind, const std::string& text);

  std::mutex mutex_;
  std::map<std::pair<Level, std::string>, Lines> lines_;  // guarded by mutex_
};

// Lines of one format are of one kind.
template <typename... Arguments>
void LogSource(SourceLog::Level level, const std::string& path, fmt::format_string<Arguments...> format,
               Arguments&&... arguments) {
  if (!SourceLog::IsWritten(level)) return;
  const auto kind = fmt::string_view(format);
  SourceLog::Write(level, {kind.data(), kind.size()}, path, fmt::format(format, std::forward<Arguments>(arguments)...));
}

}  // namespace terrace::dem
