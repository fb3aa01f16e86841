#include "server/cli/mesh/output_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace terrace::cli {

namespace fs = std::filesystem;

namespace {

fs::path TargetOf(const fs::path& path) {
  std::error_code failed;
  if (!fs::is_symlink(path, failed)) return path;
  fs::path target = fs::canonical(path, failed);
  if (!failed) return target;
  target = path;  // whose target does not exist yet
  constexpr int kMaxLinks = 40;
  for (int links = 0; links < kMaxLinks && fs::is_symlink(target, failed); ++links) {
    target = target.parent_path() / fs::read_symlink(target, failed);
  }
  return target;
}

}  // namespace

OutputFile::OutputFile(std::string path, fs::path target)
    : path_(std::move(path)),
      target_(std::move(target)),
      unfinished_(std::make_unique<UnfinishedFile>(fmt::format("{}.{}.part", target_.string(), getpid()))),
      stream_(unfinished_->path(), std::ios::binary) {}

Result<OutputFile> OutputFile::Open(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    return MakeError(ErrorCode::kUnavailable, "{} is a folder; name a file in it", path);
  }
  if (fs::exists(path, ignored) && ::access(path.c_str(), W_OK) != 0) {
    return MakeError(ErrorCode::kUnavailable, "cannot write {}: {}; remove it, or give another name", path,
                     std::generic_category().message(errno));
  }
  OutputFile file(path, TargetOf(path));
  if (!file.stream_) {
    return MakeError(ErrorCode::kUnavailable, "cannot write {}: {}; choose a folder that exists and is writable", path,
                     std::generic_category().message(errno));
  }
  // Set before anything is written, so that nobody can read data without permission.
  const fs::perms permissions = fs::status(file.target_, ignored).permissions();
  if (permissions != fs::perms::unknown) fs::permissions(file.unfinished_->path(), permissions, ignored);
  return file;
}

Result<void> OutputFile::Commit() {
  stream_.close();
  if (!stream_) return MakeError(ErrorCode::kUnavailable, "writing {} failed; is the disk full?", path_);
  std::error_code error;
  fs::rename(unfinished_->path(), target_, error);
  if (error) return MakeError(ErrorCode::kUnavailable, "cannot replace {}: {}", path_, error.message());
  return {};
}

}  // namespace terrace::cli
