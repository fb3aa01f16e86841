// The GDAL drivers of this process.
#pragma once

#include <gdal_priv.h>

#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

// The default drivers: formats of elevation models and pictures that do not fetch, run or link other files.
const std::vector<std::string>& DefaultDrivers();

// Restricts GDAL to these drivers (short names), also for files inside files. May be called again with other names,
// while no source is being opened. kInvalidArgument: GDAL has no such driver; nothing changes. Precondition: GDAL's
// drivers are registered.
Result<void> UseDrivers(const std::vector<std::string>& names);

// Returns the short name of the driver that would read the file but was removed by UseDrivers. Looks at the file's name
// and first bytes.
std::optional<std::string> LeftOutDriverOf(const std::string& path);

// Returns a driver by its short name, even if UseDrivers removed it: for files that this program writes. Null: GDAL has
// no such driver.
GDALDriver* FindDriver(const std::string& name);

// Opens a file of the installation, such as PROJ's grids, with FindDriver. Null: the file has another format, or GDAL
// has no such driver.
GDALDatasetUniquePtr OpenWithDriver(const std::string& name, const std::string& path);

}  // namespace terrace::dem
