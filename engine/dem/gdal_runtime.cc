#include "engine/dem/gdal_runtime.h"

#include <cpl_conv.h>
#include <cpl_error.h>
#include <gdal.h>
#include <ogr_srs_api.h>

#include <algorithm>
#include <mutex>
#include <utility>

namespace terrace::dem {
namespace {

constexpr GIntBig kBlockCacheBytes = GIntBig{256} << 20;

thread_local std::string last_error;

// GDAL's own handler goes silent after 1,000 messages and prints before that; ours keeps the last one, for our Errors.
void CPL_STDCALL KeepLastError(CPLErr severity, CPLErrorNum, const char* message) {
  if (severity >= CE_Failure) last_error = message;
}

void InitOnce() {
  CPLSetErrorHandler(KeepLastError);
  CPLSetConfigOption("GDAL_VRT_ENABLE_PYTHON", "NO");
  CPLSetConfigOption("GDAL_DRIVER_PATH", "disable");
  OSRSetPROJEnableNetwork(0);
  if (CPLGetConfigOption("GDAL_CACHEMAX", nullptr) == nullptr) {
    GDALSetCacheMax64(std::min(GDALGetCacheMax64(), kBlockCacheBytes));
  }
  GDALAllRegister();
}

}  // namespace

void InitGdal() {
  static std::once_flag once;
  std::call_once(once, InitOnce);
}

std::string TakeGdalError() {
  return last_error.empty() ? std::string("no further detail") : std::exchange(last_error, {});
}

void ForgetGdalError() { last_error.clear(); }

}  // namespace terrace::dem
