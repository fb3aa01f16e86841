#include "engine/gdal/driver_list.h"

#include <algorithm>
#include <mutex>
#include <string_view>

namespace terrace::dem {
namespace {

// GDAL uses this driver for temporary rasters. Its names begin with "MEM:::", so they are never files.
constexpr std::string_view kOwnUse = "MEM";

// Removed from GDAL's list and never freed.
std::vector<GDALDriver*>& Retired() {
  static auto& drivers = *new std::vector<GDALDriver*>;
  return drivers;
}

std::mutex& RetiredMutex() {
  static auto& mutex = *new std::mutex;
  return mutex;
}

Result<void> CheckNames(const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const bool retired = std::ranges::any_of(Retired(), [&](GDALDriver* d) { return name == d->GetDescription(); });
    if (retired || GetGDALDriverManager()->GetDriverByName(name.c_str()) != nullptr) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "allowed_drivers: \"{}\" is no format that GDAL reads here; `gdalinfo --formats` lists them",
                     name);
  }
  return {};
}

}  // namespace

const std::vector<std::string>& DefaultDrivers() {
  // The subset that this build of GDAL has.
  static const std::vector<std::string> drivers = [] {
    std::vector<std::string> names;
    for (const char* name :
         {"GTiff", "SRTMHGT", "DTED", "USGSDEM", "AAIGrid", "AIG", "GRASSASCIIGrid", "EHdr", "ENVI",       "HFA",
          "ERS",   "SAGA",    "GSAG", "GSBG",    "GS7BG",   "XYZ", "ZMap",           "RST",  "BT",         "Terragen",
          "HF2",   "SIGDEM",  "ACE2", "netCDF",  "PNM",     "PNG", "JPEG",           "WEBP", "JP2OpenJPEG"}) {
      if (GetGDALDriverManager()->GetDriverByName(name) != nullptr) names.emplace_back(name);
    }
    return names;
  }();
  return drivers;
}

Result<void> UseDrivers(const std::vector<std::string>& names) {
  const std::lock_guard lock(RetiredMutex());
  if (auto known = CheckNames(names); !known) return known;
  GDALDriverManager& manager = *GetGDALDriverManager();
  // If all drivers are registered again, new ones with the same names are created; the old ones stay here.
  std::erase_if(Retired(), [&manager](GDALDriver* driver) {
    if (manager.GetDriverByName(driver->GetDescription()) != nullptr) return false;
    manager.RegisterDriver(driver);
    return true;
  });
  for (int i = manager.GetDriverCount() - 1; i >= 0; --i) {
    GDALDriver* driver = manager.GetDriver(i);
    const std::string_view name = driver->GetDescription();
    if (name == kOwnUse || std::ranges::find(names, name) != names.end()) continue;
    manager.DeregisterDriver(driver);
    Retired().push_back(driver);
  }
  return {};
}

std::optional<std::string> LeftOutDriverOf(const std::string& path) {
  const std::lock_guard lock(RetiredMutex());
  GDALOpenInfo file(path.c_str(), GA_ReadOnly);
  for (GDALDriver* const driver : Retired()) {
    const bool is_raster = driver->GetMetadataItem(GDAL_DCAP_RASTER) != nullptr;
    if (is_raster && driver->pfnIdentify != nullptr && driver->pfnIdentify(&file) > 0) return driver->GetDescription();
  }
  return std::nullopt;
}

GDALDriver* FindDriver(const std::string& name) {
  const std::lock_guard lock(RetiredMutex());
  for (GDALDriver* const retired : Retired()) {
    if (name == retired->GetDescription()) return retired;
  }
  return GetGDALDriverManager()->GetDriverByName(name.c_str());
}

GDALDatasetUniquePtr OpenWithDriver(const std::string& name, const std::string& path) {
  GDALDriver* const driver = FindDriver(name);
  if (driver == nullptr || driver->pfnOpen == nullptr) return nullptr;
  GDALOpenInfo file(path.c_str(), GDAL_OF_RASTER | GDAL_OF_READONLY);
  return GDALDatasetUniquePtr(driver->pfnOpen(&file));
}

}  // namespace terrace::dem
