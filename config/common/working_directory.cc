#include "config/common/working_directory.h"

namespace terrace::config {

std::string FromWorkingDirectory(std::filesystem::path directory, const std::filesystem::path& path) {
  if (directory.empty() || path.is_absolute()) return path.string();
  auto part = path.begin();
  for (; part != path.end() && (*part == "." || *part == ".."); ++part) {
    if (*part == "..") directory = directory.parent_path();
  }
  for (; part != path.end(); ++part) directory /= *part;
  return directory.string();
}

}  // namespace terrace::config
