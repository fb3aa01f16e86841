#include "bake/copy_unit.h"

#include <fcntl.h>
#include <unistd.h>

#include <filesystem>
#include <system_error>

namespace terrace::bake {
namespace {

namespace fs = std::filesystem;

// The data is on the disk before the name is.
bool Sync(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool is_done = ::fsync(descriptor) == 0;
  ::close(descriptor);
  return is_done;
}

}  // namespace

Result<archive::UnitSummary> CopyUnit(const std::string& from, const std::string& to, const archive::UnitEntry& entry) {
  const fs::path source = fs::path(from) / archive::UnitPath(entry.name),
                 target = fs::path(to) / archive::UnitPath(entry.name);
  std::error_code error;
  if (!fs::exists(source, error)) return MakeError(ErrorCode::kNotFound, "{}: is missing", source.string());
  const fs::path partial = target.string() + ".partial";
  fs::create_directories(target.parent_path(), error);
  if (!error) fs::remove(partial, error);  // of an earlier run, perhaps with other permissions
  if (!error) fs::copy_file(source, partial, error);
  if (!error && !Sync(partial)) error = std::error_code(errno, std::generic_category());
  if (!error) fs::rename(partial, target, error);
  if (error) {
    std::error_code ignored;
    fs::remove(partial, ignored);
    return MakeError(ErrorCode::kUnavailable, "{}: cannot be copied to {}: {}", source.string(), target.string(),
                     error.message());
  }
  auto copied = archive::VerifyUnit(to, entry.name, entry.key);
  const bool is_same =
      copied && copied->tiles == entry.tiles && copied->bytes == entry.bytes && copied->xxh3 == entry.xxh3;
  if (is_same) return copied;
  fs::remove(target, error);
  if (!copied) return copied;
  return MakeError(ErrorCode::kInvalidArgument, "{}: is not the file of its manifest", source.string());
}

}  // namespace terrace::bake
