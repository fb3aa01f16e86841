#include "archive/archive.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <list>
#include <mutex>
#include <unordered_map>
#include <utility>

#include "archive/files/input_file.h"
#include "archive/pmtiles/pmtiles_file.h"
#include "archive/pmtiles_mapping.h"
#include "archive/unit_name.h"
#include "engine/gdal/remote_file.h"
#include "tiler/tile/tile_bounds.h"

namespace terrace::archive {
namespace {

using FilePtr = std::shared_ptr<const PmtilesFile>;

// Common parts of both forms.
class ArchiveBase : public Archive {
 public:
  ArchiveBase(std::string place, Manifest manifest) : place_(std::move(place)), manifest_(std::move(manifest)) {}

  const std::string& place() const override { return place_; }
  const Manifest& manifest() const override { return manifest_; }
  bool is_outdated() const override { return is_outdated_; }

  Result<std::optional<ArchivedTile>> Find(const geo::TileKey& key) const override {
    const bool is_mercator = tiler::IsMercator(manifest_.kind.format);
    if (!tiler::IsInScheme(key, is_mercator) || key.level < manifest_.min_level || key.level > manifest_.max_level) {
      return std::nullopt;
    }
    const Result<FilePtr> file = FileOf(key);
    if (!file) return tl::unexpected(file.error());
    if (*file == nullptr) return std::nullopt;
    Result<std::optional<ArchivedTile>> found = (*file)->Find(TileIdOf(PmtilesKeyOf(key, is_mercator)));
    if (!found) Forget(key);
    return found;
  }

  Result<std::optional<dem::HeightRange>> FindRange(const geo::TileKey& key) const override {
    const Result<std::optional<ArchivedTile>> found = Find(key);
    if (!found) return tl::unexpected(found.error());
    if (!*found) return std::nullopt;
    return (*found)->range;
  }

  Result<void> ForEach(const TakeTile& take) const override {
    const bool is_mercator = tiler::IsMercator(manifest_.kind.format);
    const auto take_checked = [&](std::uint64_t tile_id, ArchivedTile tile) -> Result<void> {
      const std::optional<geo::TileKey> key = TileKeyOf(tile_id, is_mercator);
      if (!key) return MakeError(ErrorCode::kUnavailable, "{}: tile {} lies outside its scheme", place_, tile_id);
      return take(*key, std::move(tile));
    };
    return ForEachFile([&](const PmtilesFile& file) { return file.ForEach(take_checked); });
  }

 protected:
  // Null: the archive has no file with this tile.
  virtual Result<FilePtr> FileOf(const geo::TileKey& key) const = 0;
  // The file of this tile is damaged: the next look-up opens it again, since it may have been repaired meanwhile.
  virtual void Forget(const geo::TileKey& key) const = 0;
  virtual Result<void> ForEachFile(const std::function<Result<void>(const PmtilesFile&)>& take) const = 0;
  void SetOutdated() const { is_outdated_ = true; }

 private:
  const std::string place_;
  const Manifest manifest_;
  mutable std::atomic<bool> is_outdated_{false};
};

class SingleArchive final : public ArchiveBase {
 public:
  SingleArchive(std::string place, Manifest manifest, FilePtr file)
      : ArchiveBase(std::move(place), std::move(manifest)), file_(std::move(file)) {}

 protected:
  Result<FilePtr> FileOf(const geo::TileKey&) const override { return file_; }
  void Forget(const geo::TileKey&) const override { SetOutdated(); }
  Result<void> ForEachFile(const std::function<Result<void>(const PmtilesFile&)>& take) const override {
    return take(*file_);
  }

 private:
  const FilePtr file_;
};

class ChunkedArchive final : public ArchiveBase {
 public:
  ChunkedArchive(std::string place, Manifest read) : ArchiveBase(std::move(place), std::move(read)) {
    for (const UnitEntry& unit : manifest().units) units_.emplace(unit.name, &unit);
  }

 protected:
  Result<FilePtr> FileOf(const geo::TileKey& key) const override {
    const auto unit = units_.find(UnitNameOf(key));
    if (unit == units_.end() || unit->second->tiles == 0) return nullptr;
    {
      const std::lock_guard lock(mutex_);
      const auto found = std::ranges::find(open_, unit->second, &Open::unit);
      if (found != open_.end()) {
        open_.splice(open_.begin(), open_, found);
        return open_.front().file;
      }
    }
    Result<FilePtr> file = OpenUnit(*unit->second);  // several threads may open it: no harm
    if (!file) return file;
    const std::lock_guard lock(mutex_);
    open_.push_front({unit->second, *file});
    if (open_.size() > kMaxOpenFiles) open_.pop_back();
    return file;
  }

  void Forget(const geo::TileKey& key) const override {
    const auto unit = units_.find(UnitNameOf(key));
    const std::lock_guard lock(mutex_);
    if (unit != units_.end()) open_.remove_if([&](const Open& open) { return open.unit == unit->second; });
  }

  Result<void> ForEachFile(const std::function<Result<void>(const PmtilesFile&)>& take) const override {
    for (const UnitEntry& unit : manifest().units) {
      if (unit.tiles == 0) continue;
      const Result<FilePtr> file = OpenUnit(unit);
      if (!file) return tl::unexpected(file.error());
      if (Result<void> taken = take(**file); !taken) return taken;
    }
    return {};
  }

 private:
  struct Open {
    const UnitEntry* unit = nullptr;
    FilePtr file;
  };

  Result<FilePtr> OpenUnit(const UnitEntry& unit) const {
    const std::string path = place() + "/" + UnitPath(unit.name);
    constexpr std::size_t kMaxMetadataBytes = std::size_t{1} << 20;  // a unit's metadata is short
    Result<std::unique_ptr<const PmtilesFile>> file = PmtilesFile::Open(path, kMaxMetadataBytes);
    if (!file) {
      if (file.error().code != ErrorCode::kNotFound) return tl::unexpected(std::move(file.error()));
      SetOutdated();
      return MakeError(ErrorCode::kUnavailable, "{} is missing, although the manifest names it; bake it again", path);
    }
    if ((*file)->bytes() != unit.bytes || UnitKeyIn((*file)->metadata()) != unit.key) {
      SetOutdated();
      return MakeError(ErrorCode::kUnavailable,
                       "{} is not the file that the manifest describes: it is of another bake; bake it again", path);
    }
    return FilePtr(*std::move(file));
  }

  std::unordered_map<std::string, const UnitEntry*> units_;  // by name
  mutable std::mutex mutex_;
  mutable std::list<Open> open_;  // most recently used first; guarded by mutex_
};

}  // namespace

Result<std::shared_ptr<const Archive>> Archive::Open(const std::string& place) {
  if (!IsSingleFile(place)) {
    Result<Manifest> manifest = ReadManifest(place);
    if (!manifest) return tl::unexpected(std::move(manifest.error()));
    return std::make_shared<const ChunkedArchive>(place, *std::move(manifest));
  }
  // Opened once, so that the manifest is that of the tiles also if the file is replaced meanwhile.
  Result<std::unique_ptr<const PmtilesFile>> file = PmtilesFile::Open(place);
  if (!file) return tl::unexpected(std::move(file.error()));
  Result<Manifest> manifest = ManifestOf(place, (*file)->metadata());
  if (!manifest) return tl::unexpected(std::move(manifest.error()));
  return std::make_shared<const SingleArchive>(place, *std::move(manifest), FilePtr(*std::move(file)));
}

Result<std::vector<std::shared_ptr<const Archive>>> Archive::OpenAll(const std::string& place) {
  std::vector<std::shared_ptr<const Archive>> archives;
  Result<std::shared_ptr<const Archive>> only = Open(place);
  if (only) return std::vector{*std::move(only)};
  if (only.error().code != ErrorCode::kNotFound) return tl::unexpected(std::move(only.error()));
  for (const auto& [name, format] : kFormatNames) {
    const std::string folder = fmt::format("{}/{}", place, name);
    if (!MayExist(folder)) continue;
    Result<std::shared_ptr<const Archive>> archive = Open(folder);
    if (!archive && dem::IsGdalName(folder) && archive.error().code == ErrorCode::kNotFound) continue;
    if (!archive) return tl::unexpected(std::move(archive.error()));
    archives.push_back(*std::move(archive));
  }
  if (archives.empty()) return tl::unexpected(std::move(only.error()));
  return archives;
}

std::vector<std::string> Archive::FilesOf(const std::string& place) {
  std::vector<std::string> files = {place, fmt::format("{}/{}", place, kManifestFile)};
  for (const auto& [name, format] : kFormatNames) files.push_back(fmt::format("{}/{}/{}", place, name, kManifestFile));
  return files;
}

}  // namespace terrace::archive
