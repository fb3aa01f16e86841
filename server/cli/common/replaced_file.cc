#include "server/cli/common/replaced_file.h"

#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <system_error>
#include <utility>

#include "engine/core/check.h"
#include "engine/core/errno_text.h"

namespace terrace::cli {

namespace fs = std::filesystem;

namespace {

// Static memory for the signal handler, which may run on any thread.
std::array<char, PATH_MAX> path_of_file{};
std::atomic<bool> has_file = false;
static_assert(std::atomic<bool>::is_always_lock_free);

void RemoveAndEnd(int signal) {
  if (has_file.load()) ::unlink(path_of_file.data());
  if (::getpid() == 1) ::_exit(128 + signal);  // the kernel would drop the signal
  ::signal(signal, SIG_DFL);
  ::raise(signal);
}

// In the folder of `target`, and not longer than a name may be.
std::string TemporaryName(const fs::path& target) {
  constexpr std::size_t kMaxNameBytes = NAME_MAX - 32;
  return target.parent_path() /
         fmt::format("{}.{}.part", target.filename().string().substr(0, kMaxNameBytes), getpid());
}

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

// Files with longer paths cannot be opened.
TemporaryFile::TemporaryFile(std::string path) : path_(std::move(path)) {
  TERRACE_CHECK(!has_file.load());
  if (path_.size() >= path_of_file.size()) return;
  path_.copy(path_of_file.data(), path_.size());
  path_of_file[path_.size()] = '\0';
  has_file.store(true);
  for (const int number : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGPIPE}) {
    struct sigaction before {};
    if (::sigaction(number, nullptr, &before) != 0 || before.sa_handler == SIG_IGN) continue;
    ::signal(number, RemoveAndEnd);
  }
}

// After a rename there is no file to remove.
TemporaryFile::~TemporaryFile() {
  has_file.store(false);
  ::unlink(path_.c_str());
}

ReplacedFile::ReplacedFile(std::string path, fs::path target)
    : path_(std::move(path)),
      target_(std::move(target)),
      temporary_(std::make_unique<TemporaryFile>(TemporaryName(target_))),
      stream_(temporary_->path(), std::ios::binary) {}

Result<ReplacedFile> ReplacedFile::Open(const std::string& path) {
  std::error_code ignored;
  if (fs::is_directory(path, ignored)) {
    return MakeError(ErrorCode::kUnavailable, "{} is a folder; name a file in it", path);
  }
  // A rename would replace a device or a pipe by a file.
  if (fs::exists(path, ignored) && !fs::is_regular_file(path, ignored)) {
    return MakeError(ErrorCode::kUnavailable, "{} is a device or a pipe; name a file", path);
  }
  if (fs::exists(path, ignored) && ::access(path.c_str(), W_OK) != 0) {
    return MakeError(ErrorCode::kUnavailable, "cannot write {}: {}; remove it, or give another name", path,
                     ErrorText());
  }
  ReplacedFile file(path, TargetOf(path));
  if (!file.stream_) {
    return MakeError(ErrorCode::kUnavailable, "cannot write {}: {}; choose a folder that exists and is writable", path,
                     ErrorText());
  }
  // Set before anything is written, so that nobody can read data without permission.
  const fs::perms permissions = fs::status(file.target_, ignored).permissions();
  if (permissions != fs::perms::unknown) fs::permissions(file.temporary_->path(), permissions, ignored);
  return file;
}

Result<void> ReplacedFile::Commit() {
  stream_.close();
  if (!stream_) return MakeError(ErrorCode::kUnavailable, "writing {} failed; is the disk full?", path_);
  std::error_code error;
  fs::rename(temporary_->path(), target_, error);
  if (error) return MakeError(ErrorCode::kUnavailable, "cannot replace {}: {}", path_, error.message());
  return {};
}

}  // namespace terrace::cli
