#include "archive/archive.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <mutex>
#include <set>
#include <unordered_map>
#include <utility>

#include "archive/files/input_file.h"
#include "archive/pmtiles/pmtiles_file.h"
#include "archive/pmtiles_mapping.h"
#include "archive/unit_name.h"
#include "engine/common/idle_pool.h"
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

  Result<std::optional<ArchivedTile>> Find(const geo::TileKey& key) const override {
    const bool is_mercator = tiler::IsMercator(manifest_.kind.format);
    if (!tiler::IsInScheme(key, is_mercator) || key.level < manifest_.min_level || key.level > manifest_.max_level) {
      return std::nullopt;
    }
    return FindTile(key, TileIdOf(PmtilesKeyOf(key, is_mercator)));
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
  virtual Result<std::optional<ArchivedTile>> FindTile(const geo::TileKey& key, std::uint64_t tile_id) const = 0;
  virtual Result<void> ForEachFile(const std::function<Result<void>(const PmtilesFile&)>& take) const = 0;

 private:
  const std::string place_;
  const Manifest manifest_;
};

class SingleArchive final : public ArchiveBase {
 public:
  SingleArchive(std::string place, Manifest manifest, FilePtr file)
      : ArchiveBase(std::move(place), std::move(manifest)), file_(std::move(file)) {}

  bool is_outdated() const override { return is_outdated_; }

 protected:
  Result<std::optional<ArchivedTile>> FindTile(const geo::TileKey&, std::uint64_t tile_id) const override {
    Result<std::optional<ArchivedTile>> found = file_->Find(tile_id);
    if (!found) is_outdated_ = true;
    return found;
  }
  Result<void> ForEachFile(const std::function<Result<void>(const PmtilesFile&)>& take) const override {
    return take(*file_);
  }

 private:
  const FilePtr file_;
  mutable std::atomic<bool> is_outdated_{false};
};

class ChunkedArchive final : public ArchiveBase {
 public:
  ChunkedArchive(std::string place, Manifest read) : ArchiveBase(std::move(place), std::move(read)) {
    for (const UnitEntry& unit : manifest().units) {
      if (unit.tiles == 0) continue;
      units_[unit.name].entry = &unit;
      if (!MayExist(PathOf(unit))) lost_.insert(&unit);
    }
  }

  bool is_outdated() const override {
    const std::lock_guard lock(mutex_);
    return !lost_.empty();
  }

 protected:
  Result<std::optional<ArchivedTile>> FindTile(const geo::TileKey& key, std::uint64_t tile_id) const override {
    const auto unit = units_.find(UnitNameOf(key));
    if (unit == units_.end()) return std::nullopt;
    auto file = unit->second.idle.Take();
    if (!file) {
      Result<FilePtr> opened = OpenUnit(*unit->second.entry);
      if (!opened) return tl::unexpected(std::move(opened.error()));
      file.Set(std::make_shared<FilePtr>(*std::move(opened)));
    }
    Result<std::optional<ArchivedTile>> found = (*file)->Find(tile_id);
    // It is damaged: the next look-up opens it again, since it may have been repaired meanwhile.
    if (!found) unit->second.idle.Clear();
    return found;
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
  struct Unit {
    const UnitEntry* entry = nullptr;
    mutable dem::IdlePool<FilePtr> idle;
  };

  std::string PathOf(const UnitEntry& unit) const { return place() + "/" + UnitPath(unit.name); }

  // Notes whether the unit's file is lost.
  Result<FilePtr> OpenUnit(const UnitEntry& unit) const {
    Result<FilePtr> file = OpenFile(PathOf(unit), unit);
    const std::lock_guard lock(mutex_);
    if (file) {
      lost_.erase(&unit);
    } else {
      lost_.insert(&unit);
    }
    return file;
  }

  static Result<FilePtr> OpenFile(const std::string& path, const UnitEntry& unit) {
    constexpr std::size_t kMaxMetadataBytes = std::size_t{1} << 20;  // a unit's metadata is short
    Result<std::unique_ptr<const PmtilesFile>> file = PmtilesFile::Open(path, kMaxMetadataBytes);
    if (!file) {
      if (file.error().code != ErrorCode::kNotFound) return tl::unexpected(std::move(file.error()));
      return MakeError(ErrorCode::kUnavailable, "{} is missing, although the manifest names it; bake it again", path);
    }
    if ((*file)->bytes() != unit.bytes || UnitKeyIn((*file)->metadata()) != unit.key) {
      return MakeError(ErrorCode::kUnavailable,
                       "{} is not the file that the manifest describes: it is of another bake; bake it again", path);
    }
    return FilePtr(*std::move(file));
  }

  std::unordered_map<std::string, Unit> units_;  // with tiles, by name
  mutable std::mutex mutex_;
  mutable std::set<const UnitEntry*> lost_;  // whose files could not be opened when last tried; guarded by mutex_
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
