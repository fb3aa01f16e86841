// A file that is read at positions. Thread-safe.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "engine/core/result.h"

namespace terrace::archive {

class InputFile {
 public:
  // kNotFound: there is no such file. kUnavailable: it cannot be opened. The message names it.
  static Result<std::unique_ptr<const InputFile>> Open(const std::string& path);
  virtual ~InputFile() = default;

  // The size in bytes when the file was opened.
  virtual std::uint64_t size() const = 0;
  // All of the bytes. kUnavailable: the file is shorter, or cannot be read.
  virtual Result<std::string> Read(std::uint64_t offset, std::size_t size) const = 0;
};

// Whether the place of an archive is one file: a regular file, or a GDAL name that ends with .pmtiles.
bool IsSingleFile(const std::string& place);
// False: nothing is at this place. Always true for GDAL names, which are not looked up.
bool MayExist(const std::string& place);

// The whole file. kInvalidArgument: it is larger than `max_bytes`. Other errors as Open.
Result<std::string> ReadFile(const std::string& path, std::uint64_t max_bytes);

}  // namespace terrace::archive
