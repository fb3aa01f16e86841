#include "config/source_paths.h"

#include <glob.h>

#include <algorithm>
#include <memory>

namespace terrace::config {
namespace {

constexpr std::string_view kGlobCharacters = "*?[";

std::string EscapeForGlob(const std::string& path) {
  std::string escaped;
  for (const char c : path) {
    if (kGlobCharacters.find(c) != std::string_view::npos || c == '\\') escaped += '\\';
    escaped += c;
  }
  return escaped;
}

}  // namespace

Result<std::vector<std::string>> ExpandSource(const std::string& written, const std::filesystem::path& directory) {
  const std::string path = (directory / written).string();
  std::error_code ignored;
  if (written.find_first_of(kGlobCharacters) == std::string::npos || std::filesystem::exists(path, ignored)) {
    return std::vector<std::string>{path};
  }
  const std::filesystem::path pattern = std::filesystem::path(EscapeForGlob(directory.string())) / written;
  glob_t matches{};
  const std::unique_ptr<glob_t, void (*)(glob_t*)> owner(&matches, globfree);
  const int status = glob(pattern.c_str(), GLOB_ERR | GLOB_NOSORT, nullptr, &matches);
  if (status == GLOB_NOMATCH) return MakeError(ErrorCode::kNotFound, "no file matches {}", path);
  if (status != 0)
    return MakeError(ErrorCode::kUnavailable, "a folder on the way to {} is missing or cannot be read", path);
  std::vector<std::string> files(matches.gl_pathv, matches.gl_pathv + matches.gl_pathc);
  std::sort(files.begin(), files.end());  // glob itself would sort by locale
  return files;
}

}  // namespace terrace::config
