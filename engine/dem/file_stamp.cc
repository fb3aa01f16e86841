#include "engine/dem/file_stamp.h"

#include <sys/stat.h>
#include <xxhash.h>

#include <utility>

#include "engine/core/bytes.h"

namespace terrace::dem {

std::optional<FileStamp> StampOf(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  const auto nanoseconds = [](const timespec& time) {
    return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000 + static_cast<std::uint64_t>(time.tv_nsec);
  };
  return FileStamp{static_cast<std::uint64_t>(status.st_dev), static_cast<std::uint64_t>(status.st_ino),
                   static_cast<std::uint64_t>(status.st_size), nanoseconds(status.st_mtim),
                   nanoseconds(status.st_ctim)};
}

Error ChangedError(const std::string& path) {
  return {ErrorCode::kChanged,
          fmt::format("{} was changed, replaced or removed since it was opened; load the dataset anew", path)};
}

StampedFiles::StampedFiles(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    if (const auto stamp = StampOf(path)) {
      paths_.push_back(path);
      stamps_.push_back(*stamp);
    }
  }
}

Result<StampedFiles> StampedFiles::OfOpened(const std::vector<std::string>& paths,
                                            const std::optional<FileStamp>& before) {
  StampedFiles files(paths);
  if (StampOf(paths.front()) != before) return tl::unexpected(ChangedError(paths.front()));
  return files;
}

Result<void> StampedFiles::CheckUnchanged(const std::string& path) const {
  const auto changed = FirstChanged();
  if (!changed) return {};
  Error error = ChangedError(*changed);
  if (*changed != path) error.message = path + ": " + error.message;
  return tl::unexpected(std::move(error));
}

void StampedFiles::Append(const StampedFiles& more) {
  paths_.insert(paths_.end(), more.paths_.begin(), more.paths_.end());
  stamps_.insert(stamps_.end(), more.stamps_.begin(), more.stamps_.end());
}

std::optional<std::string> StampedFiles::FirstChanged() const {
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    if (HasChanged(i)) return paths_[i];
  }
  return std::nullopt;
}

std::uint64_t StampedFiles::fingerprint() const {
  ByteWriter writer;
  for (const FileStamp& stamp : stamps_) {
    for (const std::uint64_t part :
         {stamp.device, stamp.inode, stamp.size, stamp.modified_ns, stamp.status_changed_ns}) {
      writer.Put(part);
    }
  }
  const std::string bytes = writer.Take();
  return XXH3_64bits(bytes.data(), bytes.size());
}

}  // namespace terrace::dem
