// The formats that GDAL reads in this process.
#pragma once

#include <gdal_priv.h>

#include <optional>
#include <string>
#include <vector>

#include "engine/core/result.h"

namespace terrace::dem {

// The formats of elevation models and pictures that stand for themselves: none that fetches, runs or links others.
const std::vector<std::string>& DefaultDrivers();

// Leaves GDAL with these drivers, by their short names: files inside files find no others either. May be called again
// with others; meanwhile no source should be opened. kInvalidArgument: one that GDAL does not have; nothing changes
// then. Precondition: GDAL's drivers are registered.
Result<void> UseDrivers(const std::vector<std::string>& names);

// The format of a raster that UseDrivers left out, by GDAL's short name: what it would have been taken for. Looks at
// its name and first bytes.
std::optional<std::string> LeftOutDriverOf(const std::string& path);

// Opens a file of the program's own, such as PROJ's, with the driver of that short name, whether or not UseDrivers left
// it out. Null: it is no such file, or GDAL has no such driver.
GDALDatasetUniquePtr OpenWithDriver(const std::string& name, const std::string& path);

}  // namespace terrace::dem
