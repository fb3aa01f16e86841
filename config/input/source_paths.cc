#include "config/input/source_paths.h"

#include <glob.h>

#include <algorithm>
#include <memory>
#include <string_view>
#include <system_error>

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

Result<SourceConfig> FilesIn(const std::string& folder) {
  SourceConfig source(folder);
  source.is_folder = true;
  source.files.clear();
  std::error_code error;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    std::error_code ignored;
    if (!name.starts_with('.') && it->is_regular_file(ignored)) source.files.push_back(it->path().string());
  }
  if (error) return MakeError(ErrorCode::kUnavailable, "the folder {} cannot be read", folder);
  if (source.files.empty())
    return MakeError(ErrorCode::kNotFound, "the folder {} holds no file; put rasters there or name another", folder);
  std::sort(source.files.begin(), source.files.end());
  return source;
}

}  // namespace

Result<SourceConfig> ExpandSource(const std::string& written, const std::filesystem::path& directory) {
  const std::string path = (directory / written).string();
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return FilesIn(path);
  if (written.find_first_of(kGlobCharacters) == std::string::npos || std::filesystem::exists(path, ignored)) {
    return SourceConfig(path);
  }
  const std::filesystem::path pattern = std::filesystem::path(EscapeForGlob(directory.string())) / written;
  glob_t matches{};
  const std::unique_ptr<glob_t, void (*)(glob_t*)> owner(&matches, globfree);
  const int status = glob(pattern.c_str(), GLOB_ERR | GLOB_NOSORT, nullptr, &matches);
  if (status == GLOB_NOMATCH) return MakeError(ErrorCode::kNotFound, "no file matches");
  if (status != 0) return MakeError(ErrorCode::kUnavailable, "a folder on the way is missing or cannot be read");
  SourceConfig source(pattern.string());
  source.files.assign(matches.gl_pathv, matches.gl_pathv + matches.gl_pathc);
  std::erase_if(source.files, [&](const std::string& match) { return std::filesystem::is_directory(match, ignored); });
  if (source.files.empty())
    return MakeError(ErrorCode::kNotFound, "only folders match; for the files in them, end the glob with /*");
  std::sort(source.files.begin(), source.files.end());  // glob itself would sort by locale
  return source;
}

bool IsExpanded(const SourceConfig& source) {
  return source.is_folder || source.files.size() != 1 || source.files.front() != source.path;
}

bool HoldsOtherFiles(const SourceConfig& source) {
  const Result<SourceConfig> now = ExpandSource(source.path, {});
  return !now || now->files != source.files || now->is_folder != source.is_folder;
}

}  // namespace terrace::config
