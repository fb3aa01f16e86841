#include "engine/statistics/cache_folder.h"

#include <dirent.h>
#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <optional>
#include <utility>

#include "engine/common/open_file.h"

namespace terrace::dem {
namespace {

constexpr std::size_t kHashDigits = 16;

// "alps.tif-0123456789abcdef.statistics", also of a name with ".partial" behind it. Empty: another file's name.
std::string FinishedName(std::string name) {
  if (name.ends_with(CacheFolder::kPartial)) name.resize(name.size() - CacheFolder::kPartial.size());
  const std::size_t tail = 1 + kHashDigits + CacheFolder::kEnding.size();
  if (!name.ends_with(CacheFolder::kEnding) || name.size() <= tail) return {};
  const std::string_view hash = std::string_view(name).substr(name.size() - tail, 1 + kHashDigits);
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  return hash.front() == '-' && std::ranges::all_of(hash.substr(1), is_digit) ? name : std::string();
}

struct Folder {
  explicit Folder(const std::string& path) : entries(::opendir(path.c_str())) {}
  ~Folder() {
    if (entries != nullptr) ::closedir(entries);
  }
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;

  DIR* const entries;
};

struct Found {
  std::uint64_t device = 0, inode = 0;
  std::uint64_t bytes = 0;
  std::int64_t modified_ns = 0;
};

// Nothing if it is not a file of terrace's; a link is not.
std::optional<Found> LookAt(int folder, const char* name) {
  const OpenFile file(::openat(folder, name, O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  std::uint64_t magic = 0;
  if (!file.is_open() || ::fstat(file.get(), &status) != 0 || !S_ISREG(status.st_mode) ||
      !ReadAt(file.get(), 0, &magic, sizeof magic) || magic != CacheFolder::kMagic) {
    return std::nullopt;
  }
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  return Found{status.st_dev, status.st_ino, static_cast<std::uint64_t>(status.st_size),
               status.st_mtim.tv_sec * kNanoseconds + status.st_mtim.tv_nsec};
}

}  // namespace

CacheFolder::CacheFolder(std::string path, std::uint64_t max_bytes) : path_(std::move(path)), max_bytes_(max_bytes) {}

CacheFolder::~CacheFolder() = default;

CacheFolder::Use::Use(std::shared_ptr<CacheFolder> folder, const std::string& file)
    : folder_(std::move(folder)), name_(std::filesystem::path(file).filename().string()) {
  const std::lock_guard lock(folder_->mutex_);
  folder_->in_use_.insert(name_);
}

CacheFolder::Use::~Use() {
  const std::lock_guard lock(folder_->mutex_);
  folder_->in_use_.erase(folder_->in_use_.find(name_));
  folder_->problems_.erase(this);
}

void CacheFolder::Use::Fail(const std::string& reason) const {
  const std::lock_guard lock(folder_->mutex_);
  const bool is_first = folder_->problems_.empty();
  folder_->problems_[this] = reason;
  if (is_first) {
    spdlog::warn("cache_dir {}: {}: {}; averages of such sources are kept in memory as far as they fit", folder_->path_,
                 name_, reason);
  }
}

void CacheFolder::Use::Succeed() const {
  const std::lock_guard lock(folder_->mutex_);
  if (folder_->problems_.erase(this) > 0 && folder_->problems_.empty()) {
    spdlog::info("cache_dir {}: all sources are kept there again", folder_->path_);
  }
}

std::string CacheFolder::problem() const {
  const std::lock_guard lock(mutex_);
  return problems_.empty() ? std::string() : problems_.begin()->second;
}

bool CacheFolder::IsInUse(const std::string& name) const { return in_use_.contains(FinishedName(name)); }

void CacheFolder::Scan() {
  bytes_ = since_scan_ = 0;
  scanned_at_ = std::chrono::steady_clock::now();
  oldest_first_.clear();
  const Folder folder(path_);
  if (folder.entries == nullptr) return;
  while (const dirent* const entry = ::readdir(folder.entries)) {
    const std::string name = entry->d_name;
    if (FinishedName(name).empty()) continue;
    const auto found = LookAt(::dirfd(folder.entries), name.c_str());
    if (!found) continue;
    bytes_ += found->bytes;
    if (IsInUse(name)) continue;
    oldest_first_.emplace(found->modified_ns,
                          File{name, found->device, found->inode, found->bytes, found->modified_ns});
  }
}

// Removes the oldest files until they had at least `bytes` bytes. Keeps files that another process has used, replaced
// or is writing.
void CacheFolder::Evict(std::uint64_t bytes) {
  std::uint64_t gone = 0;
  while (gone < bytes && !oldest_first_.empty()) {
    const File file = std::move(oldest_first_.extract(oldest_first_.begin()).mapped());
    if (IsInUse(file.name)) continue;
    const std::string path = (std::filesystem::path(path_) / file.name).string();
    const OpenFile opened(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    const bool is_written = opened.is_open() && ::flock(opened.get(), LOCK_EX | LOCK_NB) != 0;
    const auto now = LookAt(AT_FDCWD, path.c_str());
    if (!now || is_written || now->device != file.device || now->inode != file.inode ||
        now->modified_ns != file.modified_ns) {
      continue;
    }
    if (::unlink(path.c_str()) != 0) continue;
    spdlog::debug("cache_dir {}: {} was not used for longest and is removed", path_, file.name);
    gone += file.bytes;
    bytes_ -= std::min(bytes_, file.bytes);
  }
}

// Several processes write between their scans. Each scans before it has written a 16th of the budget, and keeps an
// eighth of it free. So two of them do not exceed it.
Result<void> CacheFolder::Reserve(std::uint64_t bytes) {
  if (max_bytes_ == kUnbounded) return {};
  const std::lock_guard lock(mutex_);
  // If the folder is full of files in use, tens of thousands of them are not examined again for each new file.
  constexpr std::chrono::seconds kPause{2};
  const auto fits = [&] { return bytes <= max_bytes_ && bytes_ <= max_bytes_ - bytes; };
  const bool is_known = scanned_at_ && since_scan_ + bytes <= max_bytes_ / 16;
  const bool is_recent = scanned_at_ && std::chrono::steady_clock::now() - *scanned_at_ < kPause;
  if (!is_known || (!fits() && !is_recent)) Scan();
  const std::uint64_t wanted = max_bytes_ - max_bytes_ / 8;
  if (bytes_ + bytes > wanted) Evict(bytes_ + bytes - wanted);
  if (!fits()) {
    return MakeError(ErrorCode::kUnavailable,
                     "cannot be kept: files in use take {} of the {} bytes of cache_dir_bytes; raise it", bytes_,
                     max_bytes_);
  }
  bytes_ += bytes;
  since_scan_ += bytes;
  return {};
}

void CacheFolder::Release(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  bytes_ -= std::min(bytes_, bytes);
}

void CacheFolder::Trim() {
  if (max_bytes_ == kUnbounded) return;
  const std::lock_guard lock(mutex_);
  Scan();
  if (bytes_ <= max_bytes_) return;
  Evict(bytes_ - max_bytes_);
  if (bytes_ > max_bytes_) {
    spdlog::warn("cache_dir {}: files in use take {} bytes, more than the {} of cache_dir_bytes; raise it", path_,
                 bytes_, max_bytes_);
  }
}

}  // namespace terrace::dem
