// Files by descriptor: their identity, reads of whole ranges. Thread-safe.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>

namespace terrace::dem {

// Owns a file descriptor.
class OpenFile {
 public:
  explicit OpenFile(int descriptor = -1) : descriptor_(descriptor) {}
  OpenFile(OpenFile&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  OpenFile& operator=(OpenFile&& other) noexcept {
    std::swap(descriptor_, other.descriptor_);
    return *this;
  }
  ~OpenFile();
  int get() const { return descriptor_; }
  bool is_open() const { return descriptor_ >= 0; }

 private:
  int descriptor_;
};

// Identifies a file as long as it exists, whatever its content.
struct FileIdentity {
  std::uint64_t device = 0, inode = 0;

  friend bool operator==(const FileIdentity&, const FileIdentity&) = default;
};

std::optional<FileIdentity> IdentityOf(int file);
std::optional<FileIdentity> IdentityOf(const std::string& path);

// 0 if unknown.
std::uint64_t SizeOf(int file);

// Reads all bytes, or returns false.
bool ReadAt(int file, std::uint64_t offset, void* to, std::size_t bytes);
// Returns nothing if the range exceeds the `file_bytes` bytes of the file.
std::optional<std::string> ReadAt(int file, std::uint64_t offset, std::uint64_t bytes, std::uint64_t file_bytes);

// Sets the time of modification to now. Does nothing if that is not permitted.
void Touch(int file);

// `path` without links and relative parts; as it is if it cannot be resolved.
std::filesystem::path AbsolutePath(const std::string& path);

}  // namespace terrace::dem
