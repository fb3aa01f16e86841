#include "engine/dem/file_stamp.h"

#include <sys/stat.h>
#include <xxhash.h>

#include "engine/core/bytes.h"

namespace terrace::dem {

std::optional<FileStamp> StampOf(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return std::nullopt;
  constexpr std::uint64_t kNanoseconds = 1'000'000'000;
  return FileStamp{static_cast<std::uint64_t>(status.st_dev), static_cast<std::uint64_t>(status.st_ino),
                   static_cast<std::uint64_t>(status.st_size),
                   static_cast<std::uint64_t>(status.st_mtim.tv_sec) * kNanoseconds +
                       static_cast<std::uint64_t>(status.st_mtim.tv_nsec)};
}

StampedFiles::StampedFiles(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    if (const auto stamp = StampOf(path)) {
      paths_.push_back(path);
      stamps_.push_back(*stamp);
    }
  }
}

std::optional<std::string> StampedFiles::FirstChanged() const {
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    if (StampOf(paths_[i]) != stamps_[i]) return paths_[i];
  }
  return std::nullopt;
}

std::uint64_t StampedFiles::fingerprint() const {
  ByteWriter writer;
  for (const FileStamp& stamp : stamps_) {
    for (const std::uint64_t part : {stamp.device, stamp.inode, stamp.size, stamp.modified_ns}) writer.Put(part);
  }
  const std::string bytes = writer.Take();
  return XXH3_64bits(bytes.data(), bytes.size());
}

}  // namespace terrace::dem
