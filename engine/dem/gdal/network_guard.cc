#include "engine/dem/gdal/network_guard.h"

#include <cpl_string.h>
#include <cpl_vsi_virtual.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <map>
#include <string_view>

namespace terrace::dem {
namespace {

// File systems for memory and for files within files, which have no other access.
constexpr std::array<std::string_view, 12> kLocal = {
    "/vsimem/",     "/vsizip/",    "/vsigzip/",   "/vsitar/",   "/vsi7z/",     "/vsirar/",
    "/vsisubfile/", "/vsisparse/", "/vsicached?", "/vsicrypt/", "/vsistdout/", "/vsistdout_redirect/"};

class Closed : public VSIFilesystemHandler {
 public:
  using VSIFilesystemHandler::Open;
  VSIVirtualHandle* Open(const char*, const char*, bool, CSLConstList) override {
    errno = ENOENT;
    return nullptr;
  }
  int Stat(const char*, VSIStatBufL*, int) override {
    errno = ENOENT;
    return -1;
  }
};

}  // namespace

void GuardNetwork(const std::vector<std::string>& allowed_prefixes) {
  // GDAL's original file systems and their replacements. GDAL frees the ones that are installed at the end.
  static auto& doors = *new std::map<std::string, VSIFilesystemHandler*>;
  static auto& closed = *new std::map<std::string, Closed*>;
  char** prefixes = VSIFileManager::GetPrefixes();
  for (char** name = prefixes; name != nullptr && *name != nullptr; ++name) {
    const std::string prefix = *name;
    if (std::ranges::find(kLocal, prefix) != kLocal.end()) continue;
    doors.try_emplace(prefix, VSIFileManager::GetHandler((prefix + "x").c_str()));
    const bool open =
        std::ranges::any_of(allowed_prefixes, [&](const std::string& allowed) { return allowed.starts_with(prefix); });
    VSIFilesystemHandler* handler = doors[prefix];
    if (!open) {
      Closed*& shut = closed.try_emplace(prefix, nullptr).first->second;
      if (shut == nullptr) shut = new Closed;
      handler = shut;
    }
    VSIFileManager::InstallHandler(prefix, handler);
  }
  CSLDestroy(prefixes);
}

}  // namespace terrace::dem
