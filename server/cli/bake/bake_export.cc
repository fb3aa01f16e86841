#include "server/cli/bake/bake_export.h"

#include <filesystem>
#include <system_error>
#include <vector>

#include "archive/archive.h"
#include "archive/export.h"
#include "archive/manifest.h"
#include "bake/place_files.h"

namespace terrace::cli {

namespace fs = std::filesystem;

Result<void> CheckExportPlace(const std::string& out) {
  std::error_code error;
  const bool is_taken = fs::is_directory(out, error) ? !fs::is_empty(out, error) : fs::exists(out, error);
  if (!is_taken) return {};
  return MakeError(ErrorCode::kInvalidArgument, "{}: is there already; remove it, or give another place with --out",
                   out);
}

namespace {

// Removes the manifest last: as long as it is there, RemoveIfExported knows the bake.
void RemoveBake(const std::string& baked) {
  std::error_code ignored;
  for (const std::string& name : bake::NamesIn(baked).value_or(std::vector<std::string>())) {
    if (name != archive::kManifestFile) fs::remove_all(fs::path(baked) / name, ignored);
  }
  fs::remove_all(baked, ignored);
}

}  // namespace

bool RemoveIfExported(const std::string& baked, const bake::BakeIdentity& identity, std::uint64_t generation) {
  if (!bake::HoldsFinishedBake(baked, identity, generation)) return false;
  RemoveBake(baked);
  return true;
}

Result<void> Export(const BakeArguments& arguments, const std::string& baked, const std::stop_token& stop) {
  const auto archive = archive::Archive::Open(baked);
  if (!archive) return tl::unexpected(archive.error());
  const auto write = arguments.form == kSingle   ? archive::WriteSingle
                     : arguments.form == kFolder ? archive::WriteFolder
                                                 : archive::Write3tz;
  const Result<void> written = write(**archive, arguments.out, stop);
  if (!written) return written;
  RemoveBake(baked);
  return {};
}

}  // namespace terrace::cli
