// A file that is there complete or not at all: written beside its name, and renamed to it at the end.
#pragma once

#include <filesystem>
#include <fstream>
#include <memory>
#include <ostream>
#include <string>

#include "engine/core/result.h"
#include "server/cli/mesh/unfinished_file.h"

namespace terrace::cli {

class OutputFile {
 public:
  // A symbolic link stays one: what it leads to is written. kUnavailable: the folder is missing or cannot be written
  // to, or the file is there and may not be written.
  static Result<OutputFile> Open(const std::string& path);

  // Without Commit nothing is left, and what was at `path` before is still there (UnfinishedFile).
  std::ostream& stream() { return stream_; }

  // Replaces what is at `path`, whose permissions stay. kUnavailable: what was written did not all reach the disk.
  Result<void> Commit();

 private:
  OutputFile(std::string path, std::filesystem::path target);

  std::string path_;              // as it was given
  std::filesystem::path target_;  // what is replaced
  std::unique_ptr<UnfinishedFile> unfinished_;
  std::ofstream stream_;
};

}  // namespace terrace::cli
