#include "server/cli/bake/bake_export.h"

#include <filesystem>
#include <system_error>

#include "archive/archive.h"
#include "archive/export.h"
#include "archive/manifest.h"

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
  const auto archives = archive::Archive::OpenAll(baked);
  if (!archives) return tl::unexpected(archives.error());
  archive::ExportOptions options;
  options.stop = stop;
  for (const auto& archive : *archives) {
    const std::string out = archives->size() == 1
                                ? arguments.out
                                : arguments.out + "/" + archive::FolderOf(archive->manifest().kind.format);
    std::error_code error;
    if (archives->size() > 1) fs::create_directories(arguments.out, error);
    const Result<void> written = arguments.form == kSingle ? archive::WriteSingle(*archive, out, options)
                                                           : archive::WriteFolder(*archive, out, options);
    if (!written) return written;
  }
  std::error_code ignored;
  fs::remove_all(baked, ignored);
  return {};
}

}  // namespace terrace::cli
