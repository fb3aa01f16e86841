#include "engine/gdal/source_policy.h"

#include <cpl_conv.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <gdal_priv.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string_view>
#include <system_error>

#include "engine/core/ascii.h"
#include "engine/core/errno_text.h"
#include "engine/gdal/driver_list.h"
#include "engine/gdal/gdal_runtime.h"
#include "engine/gdal/vrt_check.h"

namespace terrace::dem {
namespace {

namespace fs = std::filesystem;

struct State {
  std::mutex mutex;
  std::shared_ptr<const SourcePolicy> policy = std::make_shared<const SourcePolicy>();
};

State& TheState() {
  static State state;
  return state;
}

std::shared_ptr<const SourcePolicy> Current() {
  const std::lock_guard lock(TheState().mutex);
  return TheState().policy;
}

const std::vector<std::string>& DriversOf(const SourcePolicy& policy) {
  return policy.drivers.empty() ? DefaultDrivers() : policy.drivers;
}

bool IsBelow(const fs::path& path, const fs::path& root) {
  const auto [rest, ignored] = std::mismatch(root.begin(), root.end(), path.begin(), path.end());
  return rest == root.end();
}

// Accepts names that stay below an allowed prefix: no "..", options ("?") or nested names.
bool IsBelowPrefix(const SourcePolicy& policy, const std::string& path) {
  return std::ranges::any_of(policy.prefixes, [&](const std::string& prefix) {
    if (!path.starts_with(prefix)) return false;
    const std::string rest = "/" + path.substr(prefix.size());
    return rest.size() > 1 && rest.find("/../") == std::string::npos && !rest.ends_with("/..") &&
           rest.find("/vsi") == std::string::npos && rest.find_first_of("?&,{}%\\") == std::string::npos;
  });
}

Result<std::string> RealPath(const std::string& path) {
  std::error_code error;
  const fs::path real = fs::canonical(path, error);
  if (!error) return real.string();
  return MakeError(ErrorCode::kNotFound, "{}: {}; give the path of a raster file on this machine", path,
                   error.message());
}

Result<void> CheckRoots(const SourcePolicy& policy, const std::string& path, const std::string& real) {
  if (policy.roots.empty()) return {};
  if (std::ranges::any_of(policy.roots, [&](const std::string& root) { return IsBelow(real, root); })) return {};
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: lies outside of the data roots ({}){}; move it there, or add its folder to data_roots", path,
                   fmt::join(policy.roots, ", "), real == path ? "" : ": it is " + real);
}

Result<void> CheckFile(const SourcePolicy& policy, const std::string& path) {
  const auto real = RealPath(path);
  if (!real) return tl::unexpected(real.error());
  struct stat status {};
  if (::stat(real->c_str(), &status) != 0 || !S_ISREG(status.st_mode)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: not a regular file; give the path of one raster file", path);
  }
  if (auto allowed = CheckRoots(policy, path, *real); !allowed) return allowed;
  // Some drivers of GDAL open a file that cannot be read, and crash when they read it.
  if (::faccessat(AT_FDCWD, real->c_str(), R_OK, AT_EACCESS) != 0) {
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be read: {}; give this user permission to read it", path,
                     ErrorText());
  }
  return {};
}

// Files with overviews that the metadata of a raster names.
std::vector<std::string> NamedOverviews(GDALDataset& dataset, const std::string& path) {
  std::vector<std::string> files;
  for (const char* item : {"OVERVIEW_FILE", "MASK_OVERVIEW_FILE"}) {
    const char* const elsewhere = dataset.GetMetadataItem(item, "OVERVIEWS");
    if (elsewhere == nullptr) continue;
    std::string file = elsewhere;
    constexpr std::string_view kBase = ":::BASE:::";
    if (file.starts_with(kBase)) file = fs::path(path).parent_path() / file.substr(kBase.size());
    files.push_back(std::move(file));
  }
  return files;
}

// A file with overviews or a mask, which GDAL opens as any raster, with the overviews that this one names.
Result<void> CheckOverviewFile(const std::string& path) {
  if (LooksLikeVrt(path)) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a VRT, but overviews and masks must be rasters; make them anew with gdaladdo", path);
  }
  const CPLConfigOptionSetter no_list("GDAL_DISABLE_READDIR_ON_OPEN", "TRUE", /*bSetOnlyIfUndefined=*/false);
  const GDALDatasetUniquePtr dataset(GDALDataset::Open(path.c_str(), GDAL_OF_RASTER));
  ForgetGdalError();
  return dataset == nullptr ? Result<void>() : CheckNoLinks(*dataset, path);
}

Result<void> CheckOverviewsBeside(const std::string& path) {
  for (const std::string& file : SidecarsOf(path)) {
    std::error_code ignored;
    if (file.ends_with(".xml") || !fs::is_regular_file(file, ignored)) continue;
    if (auto checked = CheckOverviewFile(file); !checked) return checked;
  }
  return {};
}

// Files that GDAL opens automatically beside a raster. If they exist, they must be allowed, too.
Result<void> CheckSidecarNames(const SourcePolicy& policy, const std::string& path) {
  if (policy.roots.empty()) return {};
  for (const std::string& sidecar : SidecarsOf(path)) {
    if (::access(sidecar.c_str(), F_OK) != 0) continue;
    if (auto checked = CheckFile(policy, sidecar); !checked) return checked;
  }
  return {};
}

}  // namespace

// GDALDefaultOverviews, and GDALFindAssociatedAuxFile of the driver HFA.
std::vector<std::string> SidecarsOf(const std::string& path) {
  std::vector<std::string> names;
  for (const char* suffix :
       {".aux.xml", ".ovr", ".OVR", ".msk", ".MSK", ".msk.ovr", ".msk.OVR", ".MSK.ovr", ".MSK.OVR", ".aux", ".AUX"}) {
    names.push_back(path + suffix);
  }
  for (const char* extension : {"aux", "AUX"}) {
    std::string name = fs::path(path).replace_extension(extension);
    if (name != path) names.push_back(std::move(name));
  }
  return names;
}

std::string SidecarOf(const std::string& path, const std::string& lower) {
  std::string upper = lower;
  std::ranges::transform(upper, upper.begin(),
                         [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; });
  std::error_code unknown;
  for (const std::string& suffix : {lower, upper}) {
    if (fs::exists(path + suffix, unknown)) return path + suffix;
  }
  return "";
}

Result<void> SetSourcePolicy(const SourcePolicy& policy) {
  InitGdal();
  auto settled = std::make_shared<SourcePolicy>(policy);
  for (std::string& root : settled->roots) {
    const auto real = RealPath(root);
    if (!real || !fs::is_directory(*real)) {
      return MakeError(ErrorCode::kInvalidArgument, "data root {}: is no folder on this machine", root);
    }
    root = *real;
  }
  for (const std::string& prefix : settled->prefixes) {
    if (!prefix.starts_with("/vsi") || !prefix.ends_with('/') || std::ranges::count(prefix, '/') < 3) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "allowed_prefixes: entry {} must name a remote folder and end with '/', such as "
                       "\"/vsis3/bucket/\" or \"/vsicurl/https://example.org/dems/\"",
                       &prefix - settled->prefixes.data() + 1);  // not quoted: signed URLs are secrets
    }
  }
  State& state = TheState();
  const std::lock_guard lock(state.mutex);
  if (auto used = UseDrivers(DriversOf(*settled)); !used) return used;
  GuardNetwork(settled->prefixes);
  state.policy = std::move(settled);
  return {};
}

Result<void> AllowVrts() {
  InitGdal();
  SourcePolicy policy;
  policy.drivers = DefaultDrivers();
  policy.drivers.emplace_back("VRT");
  return SetSourcePolicy(policy);
}

bool IsOneLine(const std::string& path) { return !HasControlCharacter(path); }

std::string EscapeControls(const std::string& path) {
  std::string escaped;
  for (const char c : path) {
    if (HasControlCharacter({&c, 1})) {
      escaped += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
    } else {
      escaped += c;
    }
  }
  return escaped;
}

bool IsAllowedRemote(const std::string& path) {
  return path.starts_with("/vsi") && !HasControlCharacter(path) && IsBelowPrefix(*Current(), path);
}

bool HasDataRoots() { return !Current()->roots.empty(); }
bool AllowsRemote() { return !Current()->prefixes.empty(); }

Result<void> CheckPlainFile(const std::string& path) {
  const auto policy = Current();
  if (path.empty()) return MakeError(ErrorCode::kInvalidArgument, "the name of a source is empty");
  if (HasControlCharacter(path)) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: a file name with a control character; rename the file",
                     EscapeControls(path));
  }
  for (const char* archive : {"/vsizip/", "/vsitar/", "/vsigzip/", "/vsi7z/", "/vsirar/"}) {
    if (!path.starts_with(archive)) continue;
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a part of an archive; extract it and give the path of the file", path);
  }
  if (path.starts_with("/vsi")) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is no file on this machine, and its beginning is not among the allowed_prefixes", path);
  }
  if (auto file = CheckFile(*policy, path); !file) return file;
  return CheckSidecarNames(*policy, path);
}

Result<void> CheckSourceName(const std::string& path) {
  if (IsAllowedRemote(path)) return {};
  if (auto file = CheckPlainFile(path); !file) return file;
  if (!LooksLikeVrt(path)) return {};
  if (std::ranges::find(DriversOf(*Current()), "VRT") == DriversOf(*Current()).end()) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "{}: is a VRT, which names other files; list \"VRT\" in allowed_drivers to allow that, or make a "
                     "raster of it with gdal_translate",
                     path);
  }
  return CheckVrt(path);
}

Result<void> CheckLinks(GDALDataset& dataset, const std::string& path) {
  for (const std::string& file : NamedOverviews(dataset, path)) {
    auto checked = CheckPlainFile(file);
    if (checked) checked = CheckOverviewFile(file);
    if (!checked) {
      return MakeError(ErrorCode::kInvalidArgument, "{}: names overviews elsewhere: {}", path, checked.error().message);
    }
  }
  return CheckOverviewsBeside(path);
}

Result<void> CheckNoLinks(GDALDataset& dataset, const std::string& path) {
  if (NamedOverviews(dataset, path).empty()) return CheckOverviewsBeside(path);
  return MakeError(ErrorCode::kInvalidArgument,
                   "{}: names overviews elsewhere, which only a source may; remove OVERVIEW_FILE and "
                   "MASK_OVERVIEW_FILE from its metadata, and make overviews with gdaladdo",
                   path);
}

std::vector<std::string> ClearGdalEnvironment() {
  // Of GDAL and PROJ, then of drivers.
  constexpr std::array<std::string_view, 20> kPrefixes = {
      "GDAL_", "CPL_",   "OGR_", "OSR_",   "PROJ_", "VSI_",  "VRT_", "AAIGRID_", "DTED_", "ENVI_",
      "GRIB_", "GTIFF_", "HFA_", "ISIS3_", "JPEG_", "NITF_", "OPJ_", "PNG_",     "TIFF_", "USGSDEM_"};
  constexpr std::array<std::string_view, 3> kKept = {"GDAL_DATA", "PROJ_DATA", "PROJ_LIB"};
  std::vector<std::string> names;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string_view name(*entry, std::strcspn(*entry, "="));
    if (std::ranges::find(kKept, name) != kKept.end()) continue;
    if (std::ranges::any_of(kPrefixes, [&](std::string_view prefix) { return name.starts_with(prefix); })) {
      names.emplace_back(name);
    }
  }
  for (const std::string& name : names) ::unsetenv(name.c_str());
  std::ranges::sort(names);
  return names;
}

}  // namespace terrace::dem
