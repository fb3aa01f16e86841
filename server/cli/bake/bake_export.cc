#include "server/cli/bake/bake_export.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <filesystem>
#include <system_error>

#include "archive/archive.h"
#include "archive/export.h"
#include "archive/files/output_file.h"
#include "bake/place_files.h"
#include "bake/units.h"
#include "tiler/encoder_version.h"

namespace terrace::cli {

namespace fs = std::filesystem;

namespace {

bool IsMountPoint(const fs::path& folder) {
  struct stat here {
  }, above{};
  return ::stat(folder.c_str(), &here) == 0 && ::stat((folder / "..").c_str(), &above) == 0 &&
         (here.st_dev != above.st_dev || here.st_ino == above.st_ino);
}

}  // namespace

Result<void> CheckExportPlace(const std::string& out, const std::string& form) {
  const fs::path name = fs::path(out).filename();
  if (name == "." || name == "..") {
    return MakeError(
        ErrorCode::kInvalidArgument,
        "--out {}: the tiles replace the folder when all are done, which needs its name; give a new folder", out);
  }
  if (form == kSingle && name.extension() != ".pmtiles") {
    return MakeError(ErrorCode::kInvalidArgument,
                     "--out {}: a single file needs a name that ends with .pmtiles, by which it is known", out);
  }
  std::error_code error;
  const fs::file_status there = fs::symlink_status(out, error);
  if (!fs::exists(there)) return {};
  // An empty folder is replaced by that of the export.
  if (form == kFolder && fs::is_directory(there) && fs::is_empty(out, error)) {
    if (!IsMountPoint(out)) return {};
    return MakeError(ErrorCode::kInvalidArgument,
                     "--out {}: a file system is mounted there, and the folder cannot be replaced when all tiles are "
                     "done; give a new folder in it",
                     out);
  }
  return MakeError(ErrorCode::kInvalidArgument, "{}: is there already; remove it, or give another place with --out",
                   out);
}

Result<void> CheckSizes(const BakeArguments& arguments, const std::vector<bake::Target>& targets) {
  for (const bake::Target& target : targets) {
    const std::size_t units = bake::UnitsOf(target.manifest.available).size();
    auto fits = archive::CheckManifest(target.place, target.manifest, units);
    if (fits && arguments.form == kSingle) fits = archive::CheckSingle(arguments.out, target.manifest);
    if (!fits) return fits;
  }
  return {};
}

namespace {

// In the folder of the export. It stays there when the export is renamed.
constexpr const char* kNoteFile = "exported.txt";

// The bake, and the file or folder at `path`. Renaming keeps the inode, the size and the time; a copy, or another file
// of the same name, differs.
std::string NoteOf(const std::string& path, const std::string& form, const bake::BakeIdentity& identity,
                   std::uint64_t generation) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return {};
  return fmt::format("{}\n{} of version {}: inode {}, {} bytes, written at {}.{:09}\n", bake::ToJson(identity), form,
                     tiler::VersionText(generation), status.st_ino, status.st_size, status.st_mtim.tv_sec,
                     status.st_mtim.tv_nsec);
}

}  // namespace

bool WasExported(const std::string& baked, const BakeArguments& arguments, const bake::BakeIdentity& identity,
                 std::uint64_t generation) {
  const std::string noted = bake::ReadText(fs::path(baked) / bake::kExportFolder / kNoteFile).value_or("");
  return !noted.empty() && noted == NoteOf(arguments.out, arguments.form, identity, generation);
}

namespace {

// Removes what Export writes into the folder of the export, and the folder if nothing else is in it.
void RemoveExport(const fs::path& folder) {
  std::error_code ignored;
  for (const std::string& name : bake::NamesIn(folder).value_or(std::vector<std::string>())) {
    for (const char* const form : {kSingle, kFolder, k3tz}) {
      const bool is_partial = name.starts_with(fmt::format("{}.", form)) && name.ends_with(archive::kPartial);
      if (name == form || is_partial) fs::remove_all(folder / name, ignored);
    }
  }
  fs::remove(folder / kNoteFile, ignored);
  fs::remove(folder, ignored);
}

}  // namespace

// The note is removed last: as long as it is there, WasExported knows the bake.
void RemoveBake(const std::string& baked) {
  std::error_code ignored;
  for (const std::string& name : bake::NamesIn(baked).value_or(std::vector<std::string>())) {
    if (name != bake::kExportFolder) fs::remove_all(fs::path(baked) / name, ignored);
  }
  RemoveExport(fs::path(baked) / bake::kExportFolder);
  fs::remove(baked, ignored);
}

// The export is written in the folder of the bake. What a killed process has left there is removed first.
Result<void> Export(const BakeArguments& arguments, const std::string& baked, const bake::BakeIdentity& identity,
                    std::uint64_t generation, const std::stop_token& stop) {
  const auto archive = archive::Archive::Open(baked);
  if (!archive) return tl::unexpected(archive.error());
  const auto write = arguments.form == kSingle   ? archive::WriteSingle
                     : arguments.form == kFolder ? archive::WriteFolder
                                                 : archive::Write3tz;
  const fs::path folder = fs::path(baked) / bake::kExportFolder;
  RemoveExport(folder);
  const std::string made = folder / arguments.form;
  if (auto written = write(**archive, made, stop); !written) return written;
  const std::string note = NoteOf(made, arguments.form, identity, generation);
  if (auto noted = archive::WriteUnsynced(folder / kNoteFile, note); !noted) return noted;
  if (auto free = CheckExportPlace(arguments.out, arguments.form); !free) return free;
  if (auto renamed = archive::Rename(made, arguments.out); !renamed) return renamed;
  RemoveBake(baked);
  return {};
}

}  // namespace terrace::cli
