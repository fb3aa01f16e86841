#include "engine/gdal/stamped_files.h"

#include <cpl_string.h>
#include <cpl_vsi.h>
#include <xxhash.h>

#include <random>
#include <utility>

#include "engine/core/bytes.h"

namespace terrace::dem {
namespace {

std::uint64_t Hash(const std::string& bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

std::uint64_t NumberOfThisStart() {
  static const std::uint64_t number = std::random_device()() * 0x9E3779B97F4A7C15;
  return number;
}

// The fingerprint of a name in GDAL's virtual file systems.
std::uint64_t OtherFingerprint(const std::string& path) {
  VSIStatBufL status{};
  const bool is_known = VSIStatExL(path.c_str(), &status, VSI_STAT_EXISTS_FLAG | VSI_STAT_SIZE_FLAG) == 0;
  char** const headers = VSIGetFileMetadata(path.c_str(), "HEADERS", nullptr);
  const char* const version = CSLFetchNameValue(headers, "ETag");
  ByteWriter writer;
  writer.PutBytes(path);
  writer.Put(static_cast<std::uint64_t>(is_known ? status.st_size : 0));
  // Servers of one file agree on its ETag, but perhaps not on its time.
  writer.Put(static_cast<std::uint64_t>(is_known && version == nullptr ? status.st_mtime : 0));
  writer.PutBytes(version == nullptr ? "" : version);
  if (!is_known || (status.st_mtime == 0 && version == nullptr)) writer.Put(NumberOfThisStart());
  CSLDestroy(headers);
  return Hash(writer.Take());
}

}  // namespace

Error ChangedError(const std::string& path) {
  return {ErrorCode::kChanged,
          fmt::format("{} was changed, replaced or removed since it was opened; load the dataset anew", path)};
}

StampedFiles::StampedFiles(const std::vector<std::string>& paths) {
  for (const std::string& path : paths) {
    if (const auto stamp = StampOf(path)) {
      paths_.push_back(path);
      stamps_.push_back(*stamp);
    } else if (path.starts_with("/vsi")) {
      others_.push_back(OtherFingerprint(path));
    }
  }
}

Result<StampedFiles> StampedFiles::OfOpened(const std::vector<std::string>& paths,
                                            const std::optional<FileStamp>& before) {
  StampedFiles files(paths);
  if (StampOf(paths.front()) != before) return tl::unexpected(ChangedError(paths.front()));
  return files;
}

Result<void> StampedFiles::CheckUnchanged(const std::string& path) const {
  const auto changed = FirstChanged();
  if (!changed) return {};
  Error error = ChangedError(*changed);
  if (*changed != path) error.message = path + ": " + error.message;
  return tl::unexpected(std::move(error));
}

void StampedFiles::Append(const StampedFiles& more) {
  paths_.insert(paths_.end(), more.paths_.begin(), more.paths_.end());
  stamps_.insert(stamps_.end(), more.stamps_.begin(), more.stamps_.end());
  others_.insert(others_.end(), more.others_.begin(), more.others_.end());
}

std::optional<std::string> StampedFiles::FirstChanged() const {
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    if (HasChanged(i)) return paths_[i];
  }
  return std::nullopt;
}

std::uint64_t StampedFiles::fingerprint() const {
  ByteWriter writer;
  for (const FileStamp& stamp : stamps_) {
    for (const std::uint64_t part :
         {stamp.device, stamp.inode, stamp.size, stamp.modified_ns, stamp.status_changed_ns}) {
      writer.Put(part);
    }
  }
  for (const std::uint64_t other : others_) writer.Put(other);
  return Hash(writer.Take());
}

}  // namespace terrace::dem
