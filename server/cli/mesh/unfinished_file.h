// A file that goes when the process is interrupted.
#pragma once

#include <string>

namespace terrace::cli {

// One at a time. The file goes with this object, and where SIGINT, SIGTERM or SIGHUP ends the process, which they then
// do as ever; those that are ignored stay ignored. Whatever else ends a process leaves it.
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
