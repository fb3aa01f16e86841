#include "server/store/disk_cache.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "engine/core/errno_text.h"
#include "server/store/disk_store.h"
#include "tiler/store/tile_record.h"
#include "tiler/tile/build_id.h"

namespace terrace::server {
namespace {

// The lock ends with the process, however it ends.
class DirectoryLock {
 public:
  explicit DirectoryLock(int file) : file_(file) {}
  ~DirectoryLock() { close(file_); }
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

  off_t size() const {
    struct stat status {};
    return fstat(file_, &status) == 0 ? status.st_size : 0;
  }
  // Returns false if the disk does not accept it.
  bool SetSize(off_t size) const { return ftruncate(file_, size) == 0; }

 private:
  const int file_;
};
using LockPtr = std::shared_ptr<const DirectoryLock>;

Result<LockPtr> LockDirectory(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "lock";
  int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file < 0) {
    const std::string why = ErrorText();
    file = open(path.c_str(), O_RDONLY | O_CLOEXEC);  // a disk that has become read-only
    if (file < 0) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "disk_cache: {} cannot be written: {}; name a directory that the server may write to",
                       path.string(), why);
    }
  }
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    const bool is_used = errno == EWOULDBLOCK;
    const std::string why = ErrorText();
    close(file);
    if (!is_used) return MakeError(ErrorCode::kInvalidArgument, "disk_cache: {}: {}", path.string(), why);
    return MakeError(ErrorCode::kInvalidArgument,
                     "disk_cache: {} is used by another process; give each server a directory of its own",
                     directory.string());
  }
  return std::make_shared<const DirectoryLock>(file);
}

// What the keys of this program's records begin with.
std::string StoreVersion() {
  const std::uint64_t version = tiler::BuildId();
  return {reinterpret_cast<const char*>(&version), sizeof(version)};
}

template <typename Key>
std::string StoreKey(const Key& key) {
  return StoreVersion() + tiler::RecordKey(key);
}

// The two kinds of values as bytes.
std::string Serialize(const tiler::EncodedTile& tile) { return tiler::SerializeTile(tile); }
std::string Serialize(const tiler::RefinedTile& tile) { return tiler::SerializeRefinedTile(tile); }
Result<tiler::EncodedTile> Parse(const tiler::CacheKey& /*key*/, const std::string& bytes) {
  return tiler::ParseTile(bytes);
}
Result<tiler::RefinedTile> Parse(const tiler::RefinedTileKey& /*key*/, const std::string& bytes) {
  return tiler::ParseRefinedTile(bytes);
}

template <typename Key, typename Value>
class DiskTier final : public tiler::Store<Key, Value> {
 public:
  DiskTier(LockPtr lock, const DiskStoreOptions& options) : lock_(std::move(lock)) {
    if (options.db.capacity_bytes > 0) store_.emplace(options);
  }

  const char* name() const override { return "disk"; }
  tiler::StoreStats stats() const override { return store_ ? store_->stats() : tiler::StoreStats(); }
  void Abandon() override {
    if (store_) store_->Abandon();
  }

  void Flush() override {
    if (store_) store_->Flush();
  }

  std::optional<Value> Find(const Key& key) override {
    if (!store_) return std::nullopt;
    const std::string store_key = StoreKey(key);
    const std::optional<std::string> bytes = store_->Find(store_key);
    if (!bytes) return std::nullopt;
    Result<Value> value = Parse(key, *bytes);
    if (value) return *std::move(value);
    store_->Forget(store_key);
    return std::nullopt;
  }

  Result<std::size_t> Erase(const tiler::TileSelection& selection, const std::stop_token& stop) override {
    if (!store_) return 0;
    const std::string version = StoreVersion();
    std::vector<std::string> prefixes;
    for (int level = selection.min_level; level <= selection.max_level; ++level) {
      prefixes.push_back(version + tiler::RecordPrefix(selection.generation, level));
    }
    return store_->Erase(
        prefixes, [&](std::string_view key) { return tiler::IsSelected(selection, key.substr(version.size())); }, stop);
  }

  void Insert(const Key& key, std::shared_ptr<const Value> value) override {
    if (!store_) return;
    const std::size_t charge = BytesOf(*value);
    store_->Keep(
        StoreKey(key), [value = std::move(value)] { return Serialize(*value); }, charge);
  }

 private:
  const LockPtr lock_;  // given up after the store
  std::optional<DiskStore> store_;
};

}  // namespace

// Debian's build of RocksDB asserts, and so ends the process, on some kinds of damage when it opens a store. The lock
// file counts unfinished openings: after two, the stores are deleted. Other files in the directory are never deleted.
Result<DiskCache> OpenDiskCache(const config::DiskCacheConfig& config, std::size_t open_files, bool waits_for_room) {
  tiler::BuildId();  // taken before sources are opened, for which GDAL may load libraries
  std::error_code failed;
  std::filesystem::create_directories(config.directory, failed);
  if (failed) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "disk_cache: {} cannot be made: {}; name a directory that the server may write to",
                     config.directory, failed.message());
  }
  const Result<LockPtr> locked = LockDirectory(config.directory);
  if (!locked) return tl::unexpected(locked.error());
  const LockPtr& lock = *locked;

  constexpr off_t kMaxUnfinished = 2;
  off_t unfinished = lock->size();
  const bool anew = unfinished >= kMaxUnfinished;
  if (anew) {
    spdlog::warn(
        "disk cache in {}: the last {} starts ended while this cache was being opened, so it was emptied; check the "
        "disk",
        config.directory, unfinished);
    unfinished = 0;
  }
  lock->SetSize(unfinished + 1);
  const auto options_of = [&](const char* name, std::size_t bytes, bool compress) {
    DiskStoreOptions options;
    options.db.directory = std::filesystem::path(config.directory) / name;
    options.db.capacity_bytes = bytes > 0 ? std::max(bytes, RecordDb::kMinCapacity) : 0;
    options.db.compress = compress;
    options.db.open_files = open_files;
    options.name = name;
    options.waits_for_room = waits_for_room;
    if (anew && bytes > 0) static_cast<void>(RecordDb::Destroy(options.db));  // opening reports what is wrong
    return options;
  };
  DiskCache cache;
  cache.tiles = std::make_shared<DiskTier<tiler::CacheKey, tiler::EncodedTile>>(
      lock, options_of("tiles", config.tile_bytes, /*compress=*/false));  // compressed already, or not compressible
  cache.refinements = std::make_shared<DiskTier<tiler::RefinedTileKey, tiler::RefinedTile>>(
      lock, options_of("refinements", config.refinement_bytes, /*compress=*/true));
  lock->SetSize(0);
  return cache;
}

}  // namespace terrace::server
