#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include "engine/common/open_file.h"
#include "engine/statistics/cache_files.h"

namespace terrace::dem {
namespace {

constexpr std::size_t kHashDigits = 16;

// "alps.tif-0123456789abcdef.statistics", also of a name with ".partial" behind it. Empty: another file's name.
std::string FinishedName(std::string name) {
  if (name.ends_with(CacheFolder::Files::kPartial)) name.resize(name.size() - CacheFolder::Files::kPartial.size());
  const std::size_t tail = 1 + kHashDigits + CacheFolder::Files::kEnding.size();
  if (!name.ends_with(CacheFolder::Files::kEnding) || name.size() <= tail) return {};
  const std::string_view hash = std::string_view(name).substr(name.size() - tail, 1 + kHashDigits);
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); };
  return hash.front() == '-' && std::ranges::all_of(hash.substr(1), is_digit) ? name : std::string();
}

// Nothing if it is not a file of terrace's; a link is not.
std::optional<FileStamp> LookAt(const std::string& path) {
  const OpenFile file(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  const std::optional<FileStamp> stamp = StampOf(file.get());
  std::uint64_t magic = 0;
  const bool is_ours = stamp && ReadAt(file.get(), 0, &magic, sizeof magic) && magic == CacheFolder::Files::kMagic;
  return is_ours ? stamp : std::nullopt;
}

}  // namespace

CacheFileUse::CacheFileUse(std::shared_ptr<CacheFolder> folder, const std::string& file)
    : folder_(std::move(folder)), files_(folder_->files()), name_(std::filesystem::path(file).filename().string()) {
  const std::lock_guard lock(files_.mutex_);
  files_.in_use_.insert(name_);
}

CacheFileUse::~CacheFileUse() {
  const std::lock_guard lock(files_.mutex_);
  files_.in_use_.erase(files_.in_use_.find(name_));
  files_.problems_.erase(this);
}

void CacheFileUse::Fail(const std::string& reason) const {
  const std::lock_guard lock(files_.mutex_);
  const bool is_first = files_.problems_.empty();
  files_.problems_[this] = reason;
  if (is_first) {
    spdlog::warn("cache_dir {}: {}: {}; averages of such sources are kept in memory as far as they fit", files_.path_,
                 name_, reason);
  }
}

void CacheFileUse::Succeed() const {
  const std::lock_guard lock(files_.mutex_);
  if (files_.problems_.erase(this) > 0 && files_.problems_.empty()) {
    spdlog::info("cache_dir {}: all sources are kept there again", files_.path_);
  }
}

std::string CacheFolder::Files::problem() const {
  const std::lock_guard lock(mutex_);
  return problems_.empty() ? std::string() : problems_.begin()->second;
}

bool CacheFolder::Files::IsInUse(const std::string& name) const { return in_use_.contains(FinishedName(name)); }

void CacheFolder::Files::Scan() {
  bytes_ = since_scan_ = 0;
  scanned_at_ = std::chrono::steady_clock::now();
  oldest_first_.clear();
  std::error_code error;
  for (std::filesystem::directory_iterator entry(path_, error), end; entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (FinishedName(name).empty()) continue;
    const auto stamp = LookAt(entry->path().string());
    if (!stamp) continue;
    bytes_ += stamp->size;
    if (!IsInUse(name)) oldest_first_.emplace(static_cast<std::int64_t>(stamp->modified_ns), File{name, *stamp});
  }
}

// Removes the oldest files until they had at least `bytes` bytes. Keeps files that another process has used, replaced
// or is writing.
void CacheFolder::Files::Evict(std::uint64_t bytes) {
  std::uint64_t gone = 0;
  while (gone < bytes && !oldest_first_.empty()) {
    const File file = std::move(oldest_first_.extract(oldest_first_.begin()).mapped());
    if (IsInUse(file.name)) continue;
    const std::string path = (std::filesystem::path(path_) / file.name).string();
    const OpenFile opened(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    const bool is_written = opened.is_open() && ::flock(opened.get(), LOCK_EX | LOCK_NB) != 0;
    if (is_written || LookAt(path) != file.stamp || ::unlink(path.c_str()) != 0) continue;
    spdlog::debug("cache_dir {}: {} was not used for longest and is removed", path_, file.name);
    gone += file.stamp.size;
    bytes_ -= std::min(bytes_, file.stamp.size);
  }
}

// Several processes write between their scans. Each scans before it has written a 16th of the budget, and keeps an
// eighth of it free. So two of them do not exceed it.
Result<void> CacheFolder::Files::Reserve(std::uint64_t bytes) {
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

void CacheFolder::Files::Release(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  bytes_ -= std::min(bytes_, bytes);
}

void CacheFolder::Files::Trim() {
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

CacheFolder::CacheFolder(std::string path, std::uint64_t max_bytes)
    : files_(std::make_unique<Files>(std::move(path), max_bytes)) {}

CacheFolder::~CacheFolder() = default;

const std::string& CacheFolder::path() const { return files_->path(); }
void CacheFolder::Trim() { files_->Trim(); }
std::string CacheFolder::problem() const { return files_->problem(); }

}  // namespace terrace::dem
