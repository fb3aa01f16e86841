// Replaces a file that the user named: written under a temporary name in the same folder, renamed at the end, removed
// on signals.
#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <ostream>
#include <string>

#include "engine/core/result.h"

namespace terrace::cli {

// At most one at a time. The destructor removes the file; so do SIGINT, SIGTERM and SIGHUP before they end the process.
// Ignored signals stay ignored. If the process ends in another way, the file stays.
class TemporaryFile {
 public:
  explicit TemporaryFile(std::string path);
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile();

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

class ReplacedFile {
 public:
  // If `path` is a symbolic link, writes its target. kUnavailable: the folder is missing or not writable, the existing
  // file is not writable, or it is a device or a pipe.
  static Result<ReplacedFile> Open(const std::string& path);

  // Without Commit, the new file is removed (TemporaryFile) and the old file at `path` stays.
  std::ostream& stream() { return stream_; }

  const std::string& path() const { return path_; }  // as given

  // Replaces the file at `path` and keeps its permissions. kUnavailable: not all data could be written to the disk.
  Result<void> Commit();

 private:
  ReplacedFile(std::string path, std::filesystem::path target);

  std::string path_;              // as given
  std::filesystem::path target_;  // the file that is replaced
  std::unique_ptr<TemporaryFile> temporary_;
  std::ofstream stream_;
};

}  // namespace terrace::cli
