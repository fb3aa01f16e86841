// A file that is written completely or not at all: written to a temporary name in the same folder and renamed at the
// end.
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
class UnfinishedFile {
 public:
  explicit UnfinishedFile(std::string path);
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;
  ~UnfinishedFile();

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

class OutputFile {
 public:
  // If `path` is a symbolic link, writes its target. kUnavailable: the folder is missing or not writable, the existing
  // file is not writable, or it is a device or a pipe.
  static Result<OutputFile> Open(const std::string& path);

  // Without Commit, the new file is removed (UnfinishedFile) and the old file at `path` stays.
  std::ostream& stream() { return stream_; }

  const std::string& path() const { return path_; }  // as given

  // Replaces the file at `path` and keeps its permissions. kUnavailable: not all data could be written to the disk.
  Result<void> Commit();

 private:
  OutputFile(std::string path, std::filesystem::path target);

  std::string path_;              // as given
  std::filesystem::path target_;  // the file that is replaced
  std::unique_ptr<UnfinishedFile> unfinished_;
  std::ofstream stream_;
};

}  // namespace terrace::cli
