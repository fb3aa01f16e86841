#include "config/common/cache_place.h"

#include <cstdlib>

namespace terrace::config {
namespace {

std::string FolderOf(const char* variable) {
  const char* const value = std::getenv(variable);  // NOLINT(concurrency-mt-unsafe): nobody sets variables
  if (value == nullptr || *value != '/') return {};
  return value;
}

}  // namespace

std::string CacheDirFromEnvironment() {
  if (const std::string folders = FolderOf("CACHE_DIRECTORY"); !folders.empty()) {
    return folders.substr(0, folders.find(':'));
  }
  if (const std::string folder = FolderOf("XDG_CACHE_HOME"); !folder.empty()) return folder + "/terrace";
  if (const std::string home = FolderOf("HOME"); !home.empty()) return home + "/.cache/terrace";
  return {};
}

}  // namespace terrace::config
