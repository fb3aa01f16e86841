#include "archive/files/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <random>
#include <system_error>
#include <tuple>
#include <utility>
#include <vector>

#include "archive/files/bucket.h"
#include "engine/common/content_hash.h"
#include "engine/core/errno_text.h"

namespace terrace::archive {
namespace {

constexpr std::size_t kBufferBytes = std::size_t{1} << 20;
constexpr int kMode = 0644;

tl::unexpected<Error> CannotWrite(const std::string& path, int error) {
  return MakeError(ErrorCode::kUnavailable, "{} cannot be written: {}; free space or choose another place", path,
                   ErrorText(error));
}

Result<void> WriteAll(int descriptor, std::string_view bytes, const std::string& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return CannotWrite(path, written < 0 ? errno : EIO);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return {};
}

// A new file beside `path`, and its name. Bakers that share a place may write one file at the same time: none may
// rename or truncate what another is still writing. Below 0: errno says why.
std::pair<int, std::string> CreatePartial(const std::string& path, int access) {
  while (true) {
    std::string name = fmt::format("{}.{:08x}{}", path, std::random_device()(), kPartial);
    const int descriptor = ::open(name.c_str(), access | O_CREAT | O_EXCL | O_CLOEXEC, kMode);
    if (descriptor >= 0 || errno != EEXIST) return {descriptor, std::move(name)};
  }
}

// Where a file is until it is complete.
struct TemporaryPlace {
  bool is_object;      // an object of a bucket: in the folder of temporary files
  std::string folder;  // of temporary files for objects; else the file's own
  std::string name;    // of a file in the folder
};

TemporaryPlace TemporaryPlaceOf(const std::string& path) {
  if (!IsBucket(path)) {
    const std::string folder = std::filesystem::path(path).parent_path().string();
    return {false, folder.empty() ? "." : folder, path};
  }
  std::error_code error;
  std::string folder = std::filesystem::temp_directory_path(error).string();
  if (error) folder = "/tmp";
  return {true, folder, folder + "/terrace"};
}

// A nameless file. On file systems without nameless files it has a name for a moment. Below 0: errno says why.
int CreateNameless(const TemporaryPlace& place) {
  int descriptor = ::open(place.folder.c_str(), O_RDWR | O_TMPFILE | O_CLOEXEC, kMode);
  if (descriptor >= 0) return descriptor;
  std::string partial;
  std::tie(descriptor, partial) = CreatePartial(place.name, O_RDWR);
  if (descriptor >= 0) ::unlink(partial.c_str());
  return descriptor;
}

Result<void> MakeFolder(const TemporaryPlace& place) {
  if (const int error = CreateFolders(place.folder); error != 0) return CannotWrite(place.folder, error);
  return {};
}

}  // namespace

struct OutputFile::Impl {
  explicit Impl(const std::string& p) : path(p), place(TemporaryPlaceOf(p)) {}
  ~Impl() {
    if (descriptor < 0) return;
    ::close(descriptor);
    if (!place.is_object) ::unlink(partial.c_str());
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  Result<void> Flush() {
    Result<void> written = WriteAll(descriptor, waiting, partial);
    waiting.clear();
    return written;
  }

  const std::string path;
  const TemporaryPlace place;
  std::string partial;  // of objects: the folder of the nameless file
  dem::ContentHasher hasher;
  int descriptor = -1;
  std::uint64_t size = 0;
  std::string waiting;
};

OutputFile::OutputFile(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
OutputFile::OutputFile(OutputFile&&) noexcept = default;
OutputFile::~OutputFile() = default;

Result<OutputFile> OutputFile::Create(const std::string& path) {
  auto impl = std::make_unique<Impl>(path);
  if (Result<void> made = MakeFolder(impl->place); !made) return tl::unexpected(std::move(made.error()));
  std::tie(impl->descriptor, impl->partial) = impl->place.is_object
                                                  ? std::pair(CreateNameless(impl->place), impl->place.folder)
                                                  : CreatePartial(path, O_WRONLY);
  if (impl->descriptor < 0) return CannotWrite(impl->partial, errno);
  return OutputFile(std::move(impl));
}

Result<void> OutputFile::Write(std::string_view bytes) {
  impl_->hasher.AddBytes(bytes.data(), bytes.size());
  impl_->size += bytes.size();
  impl_->waiting += bytes;
  if (impl_->waiting.size() < kBufferBytes) return {};
  return impl_->Flush();
}

Result<void> OutputFile::Skip(std::uint64_t bytes) {
  if (Result<void> flushed = impl_->Flush(); !flushed) return flushed;
  if (::lseek(impl_->descriptor, static_cast<off_t>(bytes), SEEK_CUR) < 0) return CannotWrite(impl_->partial, errno);
  impl_->size += bytes;
  return {};
}

Result<void> OutputFile::Finish() {
  if (Result<void> flushed = impl_->Flush(); !flushed) return flushed;
  if (impl_->place.is_object) return PutFile(impl_->descriptor, impl_->path);
  if (::fsync(impl_->descriptor) != 0) return CannotWrite(impl_->partial, errno);
  if (Result<void> renamed = Rename(impl_->partial, impl_->path); !renamed) return renamed;
  ::close(std::exchange(impl_->descriptor, -1));
  return {};
}

std::uint64_t OutputFile::size() const { return impl_->size; }

std::string OutputFile::xxh3() const {
  const dem::ContentHash hash = impl_->hasher.Hash();
  return fmt::format("{:016x}{:016x}", hash.high, hash.low);
}

// Some file systems do not allow fsync of folders, and do not need it.
int SyncFolder(const std::string& folder) {
  const int descriptor = ::open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (descriptor < 0) return errno == EACCES ? 0 : errno;  // files can be made where names cannot be listed
  const int error = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return error == EINVAL || error == ENOTSUP || error == EBADF ? 0 : error;
}

int CreateFolders(const std::string& folder) {
  std::error_code error;
  std::vector<std::filesystem::path> missing;
  for (std::filesystem::path at = folder; !at.empty() && !std::filesystem::exists(at, error); at = at.parent_path()) {
    missing.push_back(at);
  }
  std::filesystem::create_directories(folder, error);
  std::error_code ignored;
  if (error && !std::filesystem::is_directory(folder, ignored)) return error.value();
  for (const std::filesystem::path& made : missing) {
    if (const int failed = SyncFolder(made.parent_path().string()); failed != 0) return failed;
  }
  return 0;
}

Result<void> Rename(const std::string& from, const std::string& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) return CannotWrite(to, errno);
  if (const int error = SyncFolder(TemporaryPlaceOf(to).folder); error != 0) return CannotWrite(to, error);
  return {};
}

Result<void> WriteUnsynced(const std::string& path, std::string_view bytes) {
  const auto open = [&] { return ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kMode); };
  int descriptor = open();
  if (descriptor < 0 && errno == ENOENT) {
    std::error_code error;
    const std::string folder = TemporaryPlaceOf(path).folder;
    std::filesystem::create_directories(folder, error);
    if (error) return CannotWrite(folder, error.value());
    descriptor = open();
  }
  if (descriptor < 0) return CannotWrite(path, errno);
  Result<void> written = WriteAll(descriptor, bytes, path);
  if (::close(descriptor) != 0 && written) return CannotWrite(path, errno);
  return written;
}

SpoolFile::SpoolFile(int descriptor, std::string folder) : descriptor_(descriptor), folder_(std::move(folder)) {}
SpoolFile::SpoolFile(SpoolFile&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      folder_(std::move(other.folder_)),
      waiting_(std::move(other.waiting_)),
      written_(other.written_) {}
SpoolFile::~SpoolFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

Result<SpoolFile> SpoolFile::Create(const std::string& path) {
  const TemporaryPlace place = TemporaryPlaceOf(path);
  if (Result<void> made = MakeFolder(place); !made) return tl::unexpected(std::move(made.error()));
  const int descriptor = CreateNameless(place);
  if (descriptor < 0) return CannotWrite(path, errno);
  return SpoolFile(descriptor, place.folder);
}

Result<void> SpoolFile::Flush() {
  if (Result<void> written = WriteAll(descriptor_, waiting_, folder_); !written) return written;
  written_ += waiting_.size();
  waiting_.clear();
  return {};
}

Result<std::uint64_t> SpoolFile::Append(std::string_view bytes) {
  const std::uint64_t offset = written_ + waiting_.size();
  waiting_ += bytes;
  if (waiting_.size() >= kBufferBytes) {
    if (Result<void> flushed = Flush(); !flushed) return tl::unexpected(std::move(flushed.error()));
  }
  return offset;
}

Result<std::string> SpoolFile::Read(std::uint64_t offset, std::size_t size) {
  if (!waiting_.empty()) {
    if (Result<void> flushed = Flush(); !flushed) return tl::unexpected(std::move(flushed.error()));
  }
  std::string bytes(size, '\0');
  for (std::size_t done = 0; done < size;) {
    const ssize_t read = ::pread(descriptor_, bytes.data() + done, size - done, static_cast<off_t>(offset + done));
    if (read < 0 && errno == EINTR) continue;
    if (read <= 0) {
      return MakeError(ErrorCode::kUnavailable, "a temporary file in {} cannot be read: {}", folder_,
                       ErrorText(read < 0 ? errno : EIO));
    }
    done += static_cast<std::size_t>(read);
  }
  return bytes;
}

}  // namespace terrace::archive
