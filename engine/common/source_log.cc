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
  if (in_use == nullptr || in_use->Admits(level, kind, text)) spdlog::log(LevelOf(level), "{}: {}", path, text);
}

bool SourceLog::Admits(Level level, std::string_view kind, const std::string& text) {
  const std::lock_guard lock(mutex_);
  Lines& lines = lines_[{level, std::string(kind)}];
  if (++lines.count > kMaxLines) return false;
  lines.example = text;
  return true;
}

SourceLog::~SourceLog() {
  for (const auto& [kind, lines] : lines_) {
    if (lines.count <= kMaxLines) continue;
    spdlog::log(LevelOf(kind.first), "{} more sources have lines like this one: {}", lines.count - kMaxLines,
                lines.example);
  }
}

}  // namespace terrace::dem
