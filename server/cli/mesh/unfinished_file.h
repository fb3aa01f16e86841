// A temporary file that is removed when the process is interrupted.
#pragma once

#include <string>

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

}  // namespace terrace::cli
