#include "server/http/unix_socket.h"

#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <utility>

#include "engine/core/errno_text.h"

namespace terrace::server {
namespace {

tl::unexpected<Error> CannotListen(const std::string& path, std::string_view why, std::string_view remedy) {
  return MakeError(ErrorCode::kUnavailable, "cannot listen on unix:{}: {}; {}", path, why, remedy);
}

class Descriptor {
 public:
  Descriptor() : number_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (number_ >= 0) ::close(number_);
  }
  int get() const { return number_; }
  int Release() { return std::exchange(number_, -1); }

 private:
  int number_;
};

// The length of the path was checked when the configuration was read.
sockaddr_un AddressOf(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  return address;
}

// Whether there is a socket on which nobody listens.
Result<bool> IsStale(const std::string& path) {
  struct stat found {};
  if (::lstat(path.c_str(), &found) != 0) {
    if (errno == ENOENT) return false;
    return CannotListen(path, ErrorText(), "choose another path");
  }
  if (!S_ISSOCK(found.st_mode))
    return CannotListen(path, "something else lies there", "remove it, or choose another path");
  const Descriptor caller;
  const sockaddr_un address = AddressOf(path);
  if (::connect(caller.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    if (errno == ECONNREFUSED) return true;
    return CannotListen(path, ErrorText(), "choose another path");
  }
  return CannotListen(path, "another process listens there", "stop it, or choose another path");
}

}  // namespace

SocketFile::SocketFile(std::string path) : path_(std::move(path)) {
  struct stat found {};
  if (::lstat(path_.c_str(), &found) != 0) return;
  device_ = found.st_dev;
  inode_ = found.st_ino;
}

SocketFile::SocketFile(SocketFile&& other) noexcept
    : path_(std::exchange(other.path_, {})), device_(other.device_), inode_(other.inode_) {}

SocketFile& SocketFile::operator=(SocketFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(device_, other.device_);
  std::swap(inode_, other.inode_);
  return *this;
}

SocketFile::~SocketFile() { Remove(); }

void SocketFile::Remove() {
  const std::string path = std::exchange(path_, {});
  struct stat found {};
  if (path.empty() || ::lstat(path.c_str(), &found) != 0) return;
  if (found.st_dev == device_ && found.st_ino == inode_) ::unlink(path.c_str());
}

Result<PathSocket> ListenOnPath(const std::string& path, unsigned mode) {
  const Result<bool> is_stale = IsStale(path);
  if (!is_stale) return tl::unexpected(is_stale.error());
  if (*is_stale) ::unlink(path.c_str());
  Descriptor socket;
  const sockaddr_un address = AddressOf(path);
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return CannotListen(path, ErrorText(), "choose a path in a folder that exists and can be written");
  }
  SocketFile file(path);
  // Nobody can connect before it listens. So the mode of the umask, which the file has until then, does not matter.
  if (::chmod(path.c_str(), mode) != 0 || ::listen(socket.get(), SOMAXCONN) != 0) {
    return CannotListen(path, ErrorText(), "choose another path");
  }
  return PathSocket{socket.Release(), std::move(file)};
}

Result<void> CheckSocketPath(const std::string& path) {
  const Result<bool> is_stale = IsStale(path);
  if (!is_stale) return tl::unexpected(is_stale.error());
  const std::string folder = std::filesystem::path(path).parent_path().string();
  if (::access(folder.c_str(), W_OK | X_OK) == 0) return {};
  return CannotListen(path, ErrorText(), "choose a path in a folder that exists and can be written");
}

}  // namespace terrace::server
