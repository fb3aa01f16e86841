#include "server/cli/output_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

namespace terrace::cli {

OutputFile::OutputFile(std::string path, std::string unfinished)
    : path_(std::move(path)), unfinished_(std::move(unfinished)), stream_(unfinished_, std::ios::binary) {}

OutputFile::OutputFile(OutputFile&& other) noexcept
    : path_(std::move(other.path_)),
      unfinished_(std::exchange(other.unfinished_, {})),
      stream_(std::move(other.stream_)) {}

OutputFile::~OutputFile() {
  if (unfinished_.empty()) return;
  std::error_code ignored;
  std::filesystem::remove(unfinished_, ignored);
}

Result<OutputFile> OutputFile::Open(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    return MakeError(ErrorCode::kUnavailable, "{} is a folder; name a file in it", path);
  }
  OutputFile file(path, fmt::format("{}.{}.part", path, getpid()));
  if (!file.stream_) {
    return MakeError(ErrorCode::kUnavailable, "cannot write {}: {}; choose a folder that exists and is writable", path,
                     std::generic_category().message(errno));
  }
  return file;
}

Result<void> OutputFile::Commit() {
  stream_.close();
  if (!stream_) return MakeError(ErrorCode::kUnavailable, "writing {} failed; is the disk full?", path_);
  std::error_code error;
  std::filesystem::rename(unfinished_, path_, error);
  if (error) return MakeError(ErrorCode::kUnavailable, "cannot replace {}: {}", path_, error.message());
  unfinished_.clear();
  return {};
}

}  // namespace terrace::cli
