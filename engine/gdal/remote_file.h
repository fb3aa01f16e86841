// Files behind GDAL's file systems (/vsis3/, /vsicurl/ ...), read at positions. The source policy decides which.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "engine/core/result.h"

namespace terrace::dem {

// Whether a name is one of GDAL's file systems.
bool IsGdalName(const std::string& path);

// Thread-safe: one read at a time.
class RemoteFile {
 public:
  // kNotFound: there is no such file. kInvalidArgument: the policy does not allow it. kUnavailable: it cannot be read
  // now. What GDAL remembers of the file is forgotten first, so that a replaced file is read anew.
  static Result<std::unique_ptr<RemoteFile>> Open(const std::string& path);
  ~RemoteFile();
  RemoteFile(const RemoteFile&) = delete;
  RemoteFile& operator=(const RemoteFile&) = delete;

  std::uint64_t size() const;
  // All of the bytes. kUnavailable: the file is shorter, or cannot be read.
  Result<std::string> Read(std::uint64_t offset, std::size_t size) const;

 private:
  struct Impl;
  explicit RemoteFile(std::unique_ptr<Impl> impl);
  const std::unique_ptr<Impl> impl_;
};

}  // namespace terrace::dem
