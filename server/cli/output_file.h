// A file that is there complete or not at all: written beside its name, and renamed to it at the end.
#pragma once

#include <fstream>
#include <ostream>
#include <string>

#include "engine/core/result.h"

namespace terrace::cli {

class OutputFile {
 public:
  // kUnavailable: the folder is missing or cannot be written to.
  static Result<OutputFile> Open(const std::string& path);
  OutputFile(OutputFile&& other) noexcept;
  OutputFile& operator=(OutputFile&&) = delete;
  // Without Commit nothing is left, and what was at `path` before is still there.
  ~OutputFile();

  std::ostream& stream() { return stream_; }

  // Replaces what is at `path`. kUnavailable: what was written did not all reach the disk.
  Result<void> Commit();

 private:
  OutputFile(std::string path, std::string unfinished);

  std::string path_;
  std::string unfinished_;  // empty: nothing to clean up
  std::ofstream stream_;
};

}  // namespace terrace::cli
