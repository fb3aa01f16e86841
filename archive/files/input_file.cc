#include "archive/files/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <system_error>
#include <utility>

#include "engine/core/errno_text.h"
#include "engine/gdal/remote_file.h"

namespace terrace::archive {
namespace {

class LocalFile final : public InputFile {
 public:
  LocalFile(std::string path, int descriptor, std::uint64_t size)
      : path_(std::move(path)), descriptor_(descriptor), size_(size) {}
  ~LocalFile() override { ::close(descriptor_); }
  LocalFile(const LocalFile&) = delete;
  LocalFile& operator=(const LocalFile&) = delete;

  std::uint64_t size() const override { return size_; }

  Result<std::string> Read(std::uint64_t offset, std::size_t size) const override {
    if (offset > size_ || size > size_ - offset) {
      return MakeError(
          ErrorCode::kUnavailable,
          "{} is truncated or damaged: it has {} bytes, and {} bytes from byte {} are needed; copy or bake it again",
          path_, size_, size, offset);
    }
    std::string bytes(size, '\0');
    for (std::size_t done = 0; done < size;) {
      const ssize_t read = ::pread(descriptor_, bytes.data() + done, size - done, static_cast<off_t>(offset + done));
      if (read < 0 && errno == EINTR) continue;
      if (read < 0) return MakeError(ErrorCode::kUnavailable, "{} cannot be read: {}", path_, ErrorText());
      if (read == 0) return MakeError(ErrorCode::kUnavailable, "{} has become shorter since it was opened", path_);
      done += static_cast<std::size_t>(read);
    }
    return bytes;
  }

 private:
  const std::string path_;
  const int descriptor_;
  const std::uint64_t size_;
};

class GdalFile final : public InputFile {
 public:
  explicit GdalFile(std::unique_ptr<dem::RemoteFile> file) : file_(std::move(file)) {}

  std::uint64_t size() const override { return file_->size(); }
  Result<std::string> Read(std::uint64_t offset, std::size_t size) const override { return file_->Read(offset, size); }

 private:
  const std::unique_ptr<dem::RemoteFile> file_;
};

}  // namespace

Result<std::unique_ptr<const InputFile>> InputFile::Open(const std::string& path) {
  if (dem::IsGdalName(path)) {
    Result<std::unique_ptr<dem::RemoteFile>> remote = dem::RemoteFile::Open(path);
    if (!remote) return tl::unexpected(std::move(remote.error()));
    return std::make_unique<GdalFile>(*std::move(remote));
  }
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a pipe does not block either
  if (descriptor < 0) {
    const bool is_missing = errno == ENOENT || errno == ENOTDIR;
    return MakeError(is_missing ? ErrorCode::kNotFound : ErrorCode::kUnavailable, "{} cannot be opened: {}", path,
                     ErrorText());
  }
  struct stat status {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) {
    ::close(descriptor);
    return MakeError(ErrorCode::kUnavailable, "{} is no regular file", path);
  }
  return std::make_unique<LocalFile>(path, descriptor, static_cast<std::uint64_t>(status.st_size));
}

bool IsSingleFile(const std::string& place) {
  std::error_code ignored;
  return dem::IsGdalName(place) ? place.ends_with(".pmtiles") : std::filesystem::is_regular_file(place, ignored);
}

bool MayExist(const std::string& place) {
  std::error_code ignored;
  return dem::IsGdalName(place) || std::filesystem::exists(place, ignored);
}

Result<std::string> ReadFile(const std::string& path, std::uint64_t max_bytes) {
  Result<std::unique_ptr<const InputFile>> file = InputFile::Open(path);
  if (!file) return tl::unexpected(std::move(file.error()));
  if ((*file)->size() > max_bytes) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{} has {} bytes, and the limit is {}; check that it is the right file", path, (*file)->size(),
                     max_bytes);
  }
  return (*file)->Read(0, (*file)->size());
}

}  // namespace terrace::archive
