#include "server/cli/bake/bake_export.h"

#include <filesystem>
#include <system_error>

#include "archive/archive.h"
#include "archive/export.h"

namespace terrace::cli {

namespace fs = std::filesystem;

Result<void> CheckExportPlace(const std::string& out) {
  std::error_code error;
  const bool is_taken = fs::is_directory(out, error) ? !fs::is_empty(out, error) : fs::exists(out, error);
  if (!is_taken) return {};
  return MakeError(ErrorCode::kInvalidArgument, "{}: is there already; remove it, or give another place with --out",
                   out);
}

Result<void> Export(const BakeArguments& arguments, const std::string& baked, const std::stop_token& stop) {
  const auto archive = archive::Archive::Open(baked);
  if (!archive) return tl::unexpected(archive.error());
  const auto write = arguments.form == kSingle   ? archive::WriteSingle
                     : arguments.form == kFolder ? archive::WriteFolder
                                                 : archive::Write3tz;
  const Result<void> written = write(**archive, arguments.out, stop);
  if (!written) return written;
  std::error_code ignored;
  fs::remove_all(baked, ignored);
  return {};
}

}  // namespace terrace::cli
