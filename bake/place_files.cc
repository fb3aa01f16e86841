#include "bake/place_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <random>
#include <system_error>
#include <thread>
#include <utility>

#include "archive/files/bucket.h"
#include "archive/files/input_file.h"
#include "archive/files/output_file.h"
#include "engine/core/errno_text.h"

namespace terrace::bake {

namespace fs = std::filesystem;

std::string HostName() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "unknown";
  return name.data();
}

namespace {

// The name of this process's temporary file, which is renamed to `file`.
std::string OwnPartial(const std::string& file) {
  static const unsigned random = std::random_device()();  // processes of containers may have the same host and number
  return fmt::format("{}.{}.{}.{:08x}.partial", file, HostName(), ::getpid(), random);
}

}  // namespace

Result<bool> Exists(const fs::path& file) {
  if (!archive::IsBucket(file.string())) {
    std::error_code error;
    const bool is_there = fs::exists(file, error);
    if (!error) return is_there;
    return MakeError(ErrorCode::kUnavailable, "{} cannot be looked up: {}", file.string(), error.message());
  }
  const auto opened = archive::InputFile::Open(file.string());
  if (opened) return true;
  if (opened.error().code == ErrorCode::kNotFound) return false;
  return tl::unexpected(opened.error());
}

Result<std::string> ReadText(const fs::path& file) {
  if (archive::IsBucket(file.string())) {
    constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 20;
    return archive::ReadFile(file.string(), kMaxBytes);
  }
  const auto fail = [&](int error) {
    return MakeError(error == ENOENT ? ErrorCode::kNotFound : ErrorCode::kUnavailable, "{} cannot be read: {}",
                     file.string(), ErrorText(error));
  };
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return fail(errno);
  std::string text;
  std::array<char, 4096> piece{};
  for (;;) {
    const ssize_t read = ::read(descriptor, piece.data(), piece.size());
    if (read > 0) text.append(piece.data(), static_cast<std::size_t>(read));
    if (read > 0 || (read < 0 && errno == EINTR)) continue;
    const int error = read < 0 ? errno : 0;
    ::close(descriptor);
    if (error != 0) return fail(error);
    return text;
  }
}

Result<std::vector<std::string>> NamesIn(const fs::path& folder) {
  if (archive::IsBucket(folder.string())) return archive::NamesInBucket(folder.string());
  std::error_code error;
  std::vector<std::string> names;
  for (auto entry = fs::directory_iterator(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    std::string name = entry->path().filename().string();
    // An NFS client keeps a file that was removed while it was open under such a name until it is closed.
    if (!name.starts_with(".nfs")) names.push_back(std::move(name));
  }
  if (error) return MakeError(ErrorCode::kUnavailable, "{}: cannot be read: {}", folder.string(), error.message());
  return names;
}

void Remove(const fs::path& file) {
  std::error_code ignored;
  if (archive::IsBucket(file.string())) return archive::RemoveObject(file.string());
  fs::remove(file, ignored);
}

Result<bool> CreateFile(const std::string& file, const std::string& content) {
  const auto why = [](int error) { return MakeError(ErrorCode::kUnavailable, "{}", ErrorText(error)); };
  if (archive::IsBucket(file)) {
    const auto there = archive::InputFile::Open(file);
    if (there) return false;
    if (there.error().code != ErrorCode::kNotFound) return tl::unexpected(there.error());
    if (auto put = archive::PutText(content + '\n', file); !put) return tl::unexpected(put.error());
    // Stores have no exclusive creation. Of processes that put at the same time, the last one's content stays.
    std::this_thread::sleep_for(std::chrono::seconds(1));
    const Result<std::string> text = ReadText(file);
    if (!text && text.error().code != ErrorCode::kNotFound) return tl::unexpected(text.error());
    return text && *text == content + '\n';
  }
  const std::string own = OwnPartial(file);
  {
    std::ofstream out(own, std::ios::binary);
    out << content << '\n';
    out.flush();
    if (!out) {
      const int error = errno != 0 ? errno : EIO;
      ::unlink(own.c_str());
      return why(error);
    }
  }
  // Otherwise a power failure may leave the name without the content.
  const int descriptor = ::open(own.c_str(), O_RDONLY | O_CLOEXEC);
  const int sync_error = descriptor >= 0 && ::fsync(descriptor) == 0 ? 0 : errno;
  if (descriptor >= 0) ::close(descriptor);
  if (sync_error != 0) {
    ::unlink(own.c_str());
    return why(sync_error);
  }
  int error = ::link(own.c_str(), file.c_str()) == 0 ? 0 : errno;
  // An NFS client that repeats a request whose reply was lost is told that the link exists, which it has made itself.
  struct stat status {};
  if (error == EEXIST && ::stat(own.c_str(), &status) == 0 && status.st_nlink > 1) error = 0;
  const auto has_no_links = [&] { return error == EPERM || error == EOPNOTSUPP || error == ENOSYS; };
  if (has_no_links()) {
    error = ::renameat2(AT_FDCWD, own.c_str(), AT_FDCWD, file.c_str(), RENAME_NOREPLACE) == 0 ? 0 : errno;
  }
  if (has_no_links() || error == EINVAL) {  // others may see it empty for a moment
    const int made = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
    error = made < 0 ? errno : 0;
    if (made >= 0) ::close(made);
    if (error == 0 && ::rename(own.c_str(), file.c_str()) != 0) {
      error = errno;
      ::unlink(file.c_str());
    }
  }
  ::unlink(own.c_str());
  if (error == EEXIST) return false;
  if (error != 0) return why(error);
  error = archive::SyncFolder(fs::path(file).parent_path().string());
  if (error == 0) return true;
  ::unlink(file.c_str());  // nobody would remove a lock whose owner was told that there is none
  return why(error);
}

}  // namespace terrace::bake
