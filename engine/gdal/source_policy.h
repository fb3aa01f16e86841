// The rules for names of sources: which files may be opened, and with which drivers.
// GDAL accepts far more than file names: inline XML, URLs, addresses in memory. The policy allows only regular files,
// below the data roots if any are set, and names below a remote prefix that the operator allowed. Only the listed
// drivers are available. Names inside files (the parts of a VRT, external overviews) are checked by the same rules
// before they are opened.
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

// The names beside a local raster that GDAL opens with it: masks, overviews, descriptions. They need not exist.
std::vector<std::string> SidecarsOf(const std::string& path);
// The mask (".msk") or overviews (".ovr") beside a local raster. GDAL tries the name in lower case, then in capitals.
// Empty: neither exists.
std::string SidecarOf(const std::string& path, const std::string& lower);

// Sets the policy of the process. The default is an empty policy. Thread-safe, but no source should be opened during
// the call, because it removes and restores drivers. kInvalidArgument: a root is not a folder, a prefix is not remote,
// or GDAL does not have a driver; the old policy stays in force.
Result<void> SetSourcePolicy(const SourcePolicy& policy);

// Sets the default policy with VRTs allowed, for commands that read files named by their user.
Result<void> AllowVrts();

// Checks whether a name may be passed to GDAL. Opens no file that is not allowed. kNotFound, kUnavailable (it cannot be
// read), kInvalidArgument: the message has the remedy.
Result<void> CheckSourceName(const std::string& path);

// Checks that an opened source refers to allowed files only. Call it before overviews are used.
Result<void> CheckLinks(GDALDataset& dataset, const std::string& path);

// Checks that an opened part of a VRT, or file with overviews or a mask, names no other files. It is stricter than
// CheckLinks because the files that they name would not be watched.
Result<void> CheckNoLinks(GDALDataset& dataset, const std::string& path);

// The checks of CheckSourceName that do not depend on the file's format, for files that no raster driver reads.
Result<void> CheckPlainFile(const std::string& path);

// Whether a name contains no control characters, such as newlines; names with control characters are refused.
// EscapeControls writes them as \x0a, for messages and logs.
bool IsOneLine(const std::string& path);
std::string EscapeControls(const std::string& path);

bool HasDataRoots();
bool AllowsRemote();

// Whether the name is below an allowed remote prefix. IsGdalName (remote_file.h) is true for all remote names.
bool IsAllowedRemote(const std::string& path);

// Removes the environment variables that GDAL, OGR and PROJ read, except the location of their data, because all
// settings come from the configuration. Returns the removed names. Call it from main before threads are started.
std::vector<std::string> ClearGdalEnvironment();

}  // namespace terrace::dem
