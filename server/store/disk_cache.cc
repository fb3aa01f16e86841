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
#include <system_error>
#include <utility>

#include "tiler/build_id.h"
#include "tiler/store/tile_record.h"

namespace terrace::server {
namespace {

constexpr const char *kTiles = "tiles", *kRefinements = "refinements";  // the stores' directories

std::string SystemMessage() { return std::system_category().message(errno); }

// Returns false if the disk does not accept it.
bool SetSize(int file, off_t size) { return ftruncate(file, size) == 0; }

// The lock ends with the process, however it ends.
Result<int> LockDirectory(const std::filesystem::path& directory) {
  const std::filesystem::path path = directory / "lock";
  int file = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (file < 0) {
    const std::string why = SystemMessage();
    file = open(path.c_str(), O_RDONLY | O_CLOEXEC);  // a disk that has become read-only
    if (file < 0) {
      return MakeError(ErrorCode::kInvalidArgument,
                       "disk_cache: {} cannot be written: {}; name a directory that the server may write to",
                       path.string(), why);
    }
  }
  if (flock(file, LOCK_EX | LOCK_NB) != 0) {
    const bool is_used = errno == EWOULDBLOCK;
    const std::string why = SystemMessage();
    close(file);
    if (!is_used) return MakeError(ErrorCode::kInvalidArgument, "disk_cache: {}: {}", path.string(), why);
    return MakeError(ErrorCode::kInvalidArgument,
                     "disk_cache: {} is used by another process; give each server a directory of its own",
                     directory.string());
  }
  return file;
}

DiskStoreOptions OptionsOf(const std::filesystem::path& directory, std::size_t bytes, std::size_t open_files,
                           const char* name, bool compress, bool anew) {
  DiskStoreOptions options;
  options.db.directory = directory / name;
  options.db.capacity_bytes = std::max(bytes, RecordDb::kMinCapacity);
  options.db.compress = compress;
  options.db.open_files = open_files;
  options.name = name;
  if (anew) static_cast<void>(RecordDb::Destroy(options.db));  // opening reports what is wrong
  return options;
}

template <typename Key>
std::string StoreKey(const Key& key) {
  const std::uint64_t version = tiler::BuildId();
  std::string text(reinterpret_cast<const char*>(&version), sizeof(version));
  return text + tiler::RecordKey(key);
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

}  // namespace

template <typename Key, typename Value>
class DiskCache::Tier : public tiler::Store<Key, Value> {
 public:
  explicit Tier(DiskStoreOptions options) : store_(std::move(options)) {}

  std::optional<Value> Find(const Key& key) override {
    const std::string store_key = StoreKey(key);
    const std::optional<std::string> bytes = store_.Find(store_key);
    if (!bytes) return std::nullopt;
    Result<Value> value = Parse(key, *bytes);
    if (value) return *std::move(value);
    store_.Forget(store_key);
    return std::nullopt;
  }

  void Insert(const Key& key, std::shared_ptr<const Value> value) override {
    const std::size_t charge = BytesOf(*value);
    store_.Keep(
        StoreKey(key), [value = std::move(value)] { return Serialize(*value); }, charge);
  }

  DiskStore& store() { return store_; }

 private:
  DiskStore store_;
};

Result<std::shared_ptr<DiskCache>> DiskCache::Open(const config::DiskCacheConfig& config, std::size_t open_files) {
  tiler::BuildId();  // taken before sources are opened, for which GDAL may load libraries
  std::error_code failed;
  std::filesystem::create_directories(config.directory, failed);
  if (failed) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "disk_cache: {} cannot be made: {}; name a directory that the server may write to",
                     config.directory, failed.message());
  }
  const Result<int> lock = LockDirectory(config.directory);
  if (!lock) return tl::unexpected(lock.error());
  return std::shared_ptr<DiskCache>(new DiskCache(config, open_files, *lock));
}

DiskCache::DiskCache(const config::DiskCacheConfig& config, std::size_t open_files, int lock) : lock_(lock) {
  OpenStores(config, open_files);
}

// Debian's build of RocksDB asserts, and so ends the process, on some kinds of damage when it opens a store. The lock
// file counts unfinished openings: after two, the stores are deleted. Other files in the directory are never deleted.
void DiskCache::OpenStores(const config::DiskCacheConfig& config, std::size_t open_files) {
  constexpr off_t kMaxUnfinished = 2;
  struct stat status {};
  off_t unfinished = fstat(lock_, &status) == 0 ? status.st_size : 0;
  const bool anew = unfinished >= kMaxUnfinished;
  if (anew) {
    spdlog::warn("disk cache in {}: {} starts ended while it was opened; begun anew, check the disk", config.directory,
                 unfinished);
    unfinished = 0;
  }
  SetSize(lock_, unfinished + 1);
  if (config.tile_bytes > 0) {  // compressed already, or not compressible
    tiles_ = std::make_unique<Tier<tiler::CacheKey, tiler::EncodedTile>>(
        OptionsOf(config.directory, config.tile_bytes, open_files, kTiles, false, anew));
  }
  if (config.refinement_bytes > 0) {
    refinements_ = std::make_unique<Tier<tiler::RefinedTileKey, tiler::RefinedTile>>(
        OptionsOf(config.directory, config.refinement_bytes, open_files, kRefinements, true, anew));
  }
  SetSize(lock_, 0);
}

tiler::TileStore* DiskCache::tiles() { return tiles_.get(); }

tiler::RefinementStore* DiskCache::refinements() { return refinements_.get(); }

DiskCache::~DiskCache() {
  tiles_.reset();
  refinements_.reset();
  close(lock_);
}

void DiskCache::Flush() {
  if (tiles_) tiles_->store().Flush();
  if (refinements_) refinements_->store().Flush();
}

void DiskCache::Abandon() {
  if (tiles_) tiles_->store().Abandon();
  if (refinements_) refinements_->store().Abandon();
}

DiskCacheStats DiskCache::stats() const {
  DiskCacheStats stats;
  if (tiles_) stats.tiles = tiles_->store().stats();
  if (refinements_) stats.refinements = refinements_->store().stats();
  return stats;
}

}  // namespace terrace::server
