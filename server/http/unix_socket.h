// Listening on a path of the file system (a Unix socket).
#pragma once

#include <cstdint>
#include <string>

#include "engine/core/result.h"

namespace terrace::server {

// Removes the file of a socket when it is destroyed, unless another process has put its own there meanwhile.
class SocketFile {
 public:
  SocketFile() = default;
  // The socket that lies at `path` now.
  explicit SocketFile(std::string path);
  SocketFile(SocketFile&& other) noexcept;
  SocketFile& operator=(SocketFile&& other) noexcept;
  ~SocketFile();

  const std::string& path() const { return path_; }
  void Remove();

 private:
  std::string path_;  // empty: none
  std::uint64_t device_ = 0, inode_ = 0;
};

struct PathSocket {
  int descriptor = -1;  // of the caller
  SocketFile file;
};

// `mode`: of the file, who may connect: 0600, 0660 ... A socket that a killed process has left is replaced.
// kUnavailable: another process listens there, something else lies there, or the folder cannot be written; the message
// has the remedy.
Result<PathSocket> ListenOnPath(const std::string& path, unsigned mode);

// Whether ListenOnPath could succeed now. Changes nothing.
Result<void> CheckSocketPath(const std::string& path);

}  // namespace terrace::server
