#include "engine/common/open_file.h"

#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

namespace terrace::dem {

OpenFile::~OpenFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::optional<FileIdentity> IdentityOf(int file) {
  struct stat status {};
  if (::fstat(file, &status) != 0) return std::nullopt;
  return FileIdentity{status.st_dev, status.st_ino};
}

std::optional<FileIdentity> IdentityOf(const std::string& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return std::nullopt;
  return FileIdentity{status.st_dev, status.st_ino};
}

bool ReadAt(int file, std::uint64_t offset, void* to, std::size_t bytes) {
  auto* at = static_cast<char*>(to);
  while (bytes > 0) {
    const ssize_t got = ::pread(file, at, bytes, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) return false;
    at += got;
    offset += static_cast<std::uint64_t>(got);
    bytes -= static_cast<std::size_t>(got);
  }
  return true;
}
std::optional<std::string> ReadAt(int file, std::uint64_t offset, std::uint64_t bytes, std::uint64_t file_bytes) {
  if (offset > file_bytes || bytes > file_bytes - offset) return std::nullopt;
  std::string read(bytes, '\0');
  if (!ReadAt(file, offset, read.data(), bytes)) return std::nullopt;
  return read;
}

std::uint64_t SizeOf(int file) {
  struct stat status {};
  return ::fstat(file, &status) == 0 ? static_cast<std::uint64_t>(status.st_size) : 0;
}

void Touch(int file) { ::futimens(file, nullptr); }

std::filesystem::path AbsolutePath(const std::string& path) {
  std::error_code unresolved;
  std::filesystem::path whole = std::filesystem::weakly_canonical(path, unresolved);
  return unresolved ? std::filesystem::path(path) : whole;
}

}  // namespace terrace::dem
