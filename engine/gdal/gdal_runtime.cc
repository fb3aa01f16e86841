#include "engine/gdal/gdal_runtime.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <cpl_string.h>
#include <cpl_vsi_virtual.h>
#include <dlfcn.h>
#include <fmt/format.h>
#include <gdal.h>
#include <ogr_srs_api.h>
#include <proj.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

#include "engine/common/idle_pool.h"
#include "engine/core/check.h"
#include "engine/gdal/driver_list.h"

namespace terrace::dem {
namespace {

constexpr GIntBig kBlockCacheBytes = GIntBig{256} << 20;  // unless SetGdalCache says otherwise

std::atomic<std::uint64_t> errors{0}, warnings{0};

thread_local std::string last_error;
thread_local std::vector<std::string> first_warnings;

// GDAL's handler prints messages and stops after 1,000 of them; this one stores messages for our errors and warnings.
// C code of GDAL's libraries calls it, so it must not throw: without memory the message is lost.
void CPL_STDCALL KeepMessage(CPLErr severity, CPLErrorNum, const char* message) try {
  if (severity == CE_Warning) {
    ++warnings;
    constexpr std::size_t kMaxWarnings = 8;
    const bool is_known = std::ranges::find(first_warnings, message) != first_warnings.end();
    if (!is_known && first_warnings.size() < kMaxWarnings) first_warnings.emplace_back(message);
  }
  if (severity < CE_Failure) return;
  ++errors;
  last_error = message;
} catch (const std::bad_alloc&) {
}

// File systems that open no file on the disk by themselves: memory, files within files, and the standard output, which
// GDAL needs to write.
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

// The HDF5 library, which reads netCDF, prints each error to stderr, on each thread that has not switched this off.
// GDAL links it; this program need not.
bool SilenceHdf5() {
  using SetPrinter = int (*)(std::int64_t stack, void* function, void* data);  // H5Eset_auto2; both may be null
  const auto set_printer = reinterpret_cast<SetPrinter>(::dlsym(RTLD_DEFAULT, "H5Eset_auto2"));
  return set_printer != nullptr && set_printer(/*stack=*/0, nullptr, nullptr) >= 0;
}

void InitOnce() {
  CPLSetErrorHandler(KeepMessage);
  CPLSetConfigOption("GDAL_VRT_ENABLE_PYTHON", "NO");
  CPLSetConfigOption("GDAL_DRIVER_PATH", "disable");
  // Without this setting, GDAL ignores the vertical datum of GeoTIFFs before version 1.1.
  CPLSetConfigOption("GTIFF_REPORT_COMPD_CS", "YES");
  // Without this one, GDAL reads the code of a deprecated system as that of its successor, up to 199 km elsewhere.
  CPLSetConfigOption("OSR_USE_NON_DEPRECATED", "NO");
  OSRSetPROJEnableNetwork(0);
  proj_log_level(nullptr, PJ_LOG_NONE);  // of the default context, which proj_grid_info uses
  GDALSetCacheMax64(kBlockCacheBytes);
  // Settings come from terrace's configuration, not from GDAL's own files.
  CPLSetConfigOption("GDAL_CONFIG_FILE", "/dev/null");
  GDALAllRegister();
  // The default; SetSourcePolicy may change it.
  const Result<void> used = UseDrivers(DefaultDrivers());
  TERRACE_CHECK(used.has_value());
  GuardNetwork({});
}

}  // namespace

void InitGdal() {
  static std::once_flag once;
  std::call_once(once, InitOnce);
}

std::string GdalVersions() {
  return fmt::format("GDAL {}, PROJ {}", GDALVersionInfo("RELEASE_NAME"), proj_info().version);
}

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

void SetGdalCache(std::size_t bytes) {
  InitGdal();
  GDALSetCacheMax64(static_cast<GIntBig>(bytes));
}

void SetOpenSources(std::size_t idle, std::size_t vrt_parts) {
  InitGdal();
  SetMaxIdle(idle);
  CPLSetConfigOption("GDAL_MAX_DATASET_POOL_SIZE", std::to_string(vrt_parts).c_str());
}

GdalCounts ReadGdalCounts() { return {errors, warnings, static_cast<std::uint64_t>(GDALGetCacheUsed64())}; }

std::string TakeGdalError() {
  return last_error.empty() ? std::string("no further detail") : std::exchange(last_error, {});
}

void ForgetGdalError() {
  // On each thread that calls GDAL.
  [[maybe_unused]] static thread_local const bool is_silent = SilenceHdf5();
  last_error.clear();
}

bool HasGdalError() { return !last_error.empty(); }

std::vector<std::string> TakeGdalWarnings() { return std::exchange(first_warnings, {}); }

}  // namespace terrace::dem
