// Log lines about the sources of a dataset. A dataset may have tens of thousands of sources: the first few lines of
// each kind are written, the others are counted.
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace terrace::dem {

// Collects the lines of all threads that have attached it (Use). Thread-safe.
class SourceLog {
 public:
  enum class Level : std::uint8_t { kDebug, kInfo, kWarn };
  static constexpr std::size_t kMaxLines = 5;  // per kind

  SourceLog() = default;
  // If `is_held`, lines are kept until Release; without it they are never written.
  explicit SourceLog(bool is_held) : is_held_(is_held) {}
  // Writes how many lines of each kind were left out.
  ~SourceLog();
  void Release();
  SourceLog(const SourceLog&) = delete;
  SourceLog& operator=(const SourceLog&) = delete;

  // Attaches the log to this thread until the end of the scope.
  class Use {
   public:
    explicit Use(SourceLog& log);
    ~Use();
    Use(const Use&) = delete;
    Use& operator=(const Use&) = delete;

   private:
    SourceLog* const before_;
  };

  static bool IsWritten(Level level);  // depends on the level of the process's log
  // Writes "PATH: TEXT". If no SourceLog is attached, writes every line.
  static void Write(Level level, std::string_view kind, const std::string& path, const std::string& text);

 private:
  struct Lines {
    std::size_t count = 0;
    std::string example;  // the last text that was written
  };
  struct Line {
    Level level;
    std::string text;
  };
  void Add(Level level, std::string_view kind, const std::string& path, const std::string& text);

  std::mutex mutex_;
  bool is_held_ = false;  // guarded by mutex_, as are these
  std::vector<Line> held_;
  std::map<std::pair<Level, std::string>, Lines> lines_;
};

// The format string is the kind of the line.
template <typename... Arguments>
void LogSource(SourceLog::Level level, const std::string& path, fmt::format_string<Arguments...> format,
               Arguments&&... arguments) {
  if (!SourceLog::IsWritten(level)) return;
  const auto kind = fmt::string_view(format);
  SourceLog::Write(level, {kind.data(), kind.size()}, path, fmt::format(format, std::forward<Arguments>(arguments)...));
}

}  // namespace terrace::dem
