#include "server/cli/common/check_folder.h"

#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "engine/core/errno_text.h"

namespace terrace::cli {

Result<void> CheckFolder(const std::filesystem::path& folder) {
  std::error_code failed;
  const std::filesystem::path wanted = std::filesystem::absolute(folder, failed);
  std::filesystem::path existing = wanted;
  // A dangling symbolic link exists: no folder can be created under its name.
  const auto is_missing = [&failed](const std::filesystem::path& path) {
    return std::filesystem::symlink_status(path, failed).type() == std::filesystem::file_type::not_found;
  };
  while (existing.has_relative_path() && is_missing(existing)) {
    existing = existing.parent_path();
  }
  errno = ENOTDIR;
  if (std::filesystem::is_directory(existing, failed) && ::access(existing.c_str(), W_OK | X_OK) == 0) return {};
  const std::string in_the_way = existing == wanted ? "used" : "made: " + existing.string();
  return MakeError(ErrorCode::kUnavailable, "{} cannot be {}: {}; name a directory that may be written to",
                   folder.string(), in_the_way, ErrorText());
}

}  // namespace terrace::cli
