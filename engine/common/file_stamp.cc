#include "engine/common/file_stamp.h"

#include <sys/stat.h>

namespace terrace::dem {
namespace {

std::optional<FileStamp> StampFrom(const struct stat& status) {
  if (!S_ISREG(status.st_mode)) return std::nullopt;
  const auto nanoseconds = [](const timespec& time) {
    return static_cast<std::uint64_t>(time.tv_sec) * 1'000'000'000 + static_cast<std::uint64_t>(time.tv_nsec);
  };
  return FileStamp{static_cast<std::uint64_t>(status.st_dev), static_cast<std::uint64_t>(status.st_ino),
                   static_cast<std::uint64_t>(status.st_size), nanoseconds(status.st_mtim),
                   nanoseconds(status.st_ctim)};
}

}  // namespace

std::optional<FileStamp> StampOf(const std::string& path) {
  struct stat status {};
  return ::stat(path.c_str(), &status) == 0 ? StampFrom(status) : std::nullopt;
}

std::optional<FileStamp> StampOf(int descriptor) {
  struct stat status {};
  return ::fstat(descriptor, &status) == 0 ? StampFrom(status) : std::nullopt;
}

}  // namespace terrace::dem
