#include "engine/common/source_log.h"

#include <spdlog/spdlog.h>

namespace terrace::dem {
namespace {

thread_local SourceLog* in_use = nullptr;

spdlog::level::level_enum LevelOf(SourceLog::Level level) {
  return level == SourceLog::Level::kDebug  ? spdlog::level::debug
         : level == SourceLog::Level::kInfo ? spdlog::level::info
                                            : spdlog::level::warn;
}

}  // namespace

SourceLog::Use::Use(SourceLog& log) : before_(std::exchange(in_use, &log)) {}
SourceLog::Use::~Use() { in_use = before_; }

bool SourceLog::IsWritten(Level level) { return spdlog::should_log(LevelOf(level)); }

void SourceLog::Write(Level level, std::string_view kind, const std::string& path, const std::string& text) {
  if (in_use != nullptr) return in_use->Add(level, kind, path, text);
  spdlog::log(LevelOf(level), "{}: {}", path, text);
}

void SourceLog::Add(Level level, std::string_view kind, const std::string& path, const std::string& text) {
  const std::lock_guard lock(mutex_);
  Lines& lines = lines_[{level, std::string(kind)}];
  if (++lines.count > kMaxLines) return;
  lines.example = text;
  if (is_held_) {
    held_.push_back({level, fmt::format("{}: {}", path, text)});
  } else {
    spdlog::log(LevelOf(level), "{}: {}", path, text);
  }
}

void SourceLog::Release() {
  const std::lock_guard lock(mutex_);
  is_held_ = false;
  for (const Line& line : std::exchange(held_, {})) spdlog::log(LevelOf(line.level), "{}", line.text);
}

SourceLog::~SourceLog() {
  if (is_held_) return;
  for (const auto& [kind, lines] : lines_) {
    if (lines.count <= kMaxLines) continue;
    spdlog::log(LevelOf(kind.first), "{} more sources have lines like this one: {}", lines.count - kMaxLines,
                lines.example);
  }
}

}  // namespace terrace::dem
