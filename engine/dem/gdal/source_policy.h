// Which names may become open files, and which formats may read them.
//
// To GDAL a file name is a program: inline XML, URLs, addresses in memory. Here a name stands for one regular file,
// below the data roots if there are any, or for a name below a remote prefix that the operator allowed. Formats that
// are not listed do not exist. Names inside files (the parts of a VRT, external overviews) are checked by the same
// rules before they are opened.
#pragma once

#include <string>
#include <vector>

#include "engine/core/result.h"

class GDALDataset;

namespace terrace::dem {

struct SourcePolicy {
  std::vector<std::string> roots = {};  // folders that hold every source, symbolic links resolved; none: any folder
  // Beginnings of remote names: "/vsicurl/https://example.org/dems/"; none: no remote files.
  std::vector<std::string> prefixes = {};
  std::vector<std::string> drivers = {};  // GDAL's short names; none: DefaultDrivers() of driver_list.h

  friend bool operator==(const SourcePolicy&, const SourcePolicy&) = default;
};

// For the whole process, from now on; before the first call an empty policy holds. Thread-safe, but sources should be
// opened before or after: drivers come and go. kInvalidArgument: a root that is no folder, a prefix that is none, a
// driver that GDAL does not have; the old policy then stays.
Result<void> SetSourcePolicy(const SourcePolicy& policy);

// For commands that read what their user names: the default policy, with VRTs.
Result<void> AllowVrts();

// Whether a name may be handed to GDAL: nothing is opened but files that are allowed themselves.
// kNotFound, kInvalidArgument, with the remedy.
Result<void> CheckSourceName(const std::string& path);

// Whether a file that was opened refers to others that are not allowed. Call it before overviews are used.
Result<void> CheckLinks(GDALDataset& dataset, const std::string& path);

// The part of it that any regular file must pass, whatever is in it: for files that no raster driver reads.
Result<void> CheckPlainFile(const std::string& path);

// Whether a name has no control character, as a newline is; names that have some are refused. And a name with these
// written as \x0a, for messages and logs.
bool IsOneLine(const std::string& path);
std::string EscapeControls(const std::string& path);

bool HasDataRoots();
bool AllowsRemote();

// A name that CheckSourceName finds below an allowed remote prefix.
bool IsRemote(const std::string& path);

// Removes what GDAL, OGR and PROJ would read from the environment, except the location of their data: settings come
// from the configuration. Returns the names removed. Call it from main, before there are threads.
std::vector<std::string> ClearGdalEnvironment();

}  // namespace terrace::dem
