#include "server/tiles/disk_cache.h"

#include <fcntl.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "server/tiles/encoder_version.h"
#include "server/tiles/tile_record.h"

namespace terrace::server {
namespace {

constexpr const char *kTiles = "tiles", *kRefinements = "refinements";  // the stores' directories

std::string SystemMessage() { return std::system_category().message(errno); }

// False where the disk does not take it.
bool SetSize(int file, off_t size) { return ftruncate(file, size) == 0; }

// The lock goes with the process, however that ends.
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

std::unique_ptr<DiskStore> OpenStore(const DiskCacheOptions& cache, std::size_t bytes, const char* name, bool compress,
                                     bool anew) {
  if (bytes == 0) return nullptr;
  DiskStoreOptions options;
  options.db.directory = cache.directory / name;
  options.db.capacity_bytes = std::max(bytes, RecordDb::kMinCapacity);
  options.db.compress = compress;
  options.db.open_files = cache.open_files;
  options.db.env = cache.env;
  options.name = name;
  if (anew) static_cast<void>(RecordDb::Destroy(options.db));  // opening says what is wrong
  options.retry_after = cache.retry_after;
  return std::make_unique<DiskStore>(std::move(options));
}

template <typename Key>
std::string StoreKey(const Key& key) {
  const std::uint64_t version = EncoderVersion();
  std::string text(reinterpret_cast<const char*>(&version), sizeof(version));
  return text + RecordKey(key);
}

}  // namespace

Result<std::shared_ptr<DiskCache>> DiskCache::Open(const DiskCacheOptions& options) {
  EncoderVersion();  // taken before sources are opened, for which GDAL may load libraries
  std::error_code failed;
  std::filesystem::create_directories(options.directory, failed);
  if (failed) {
    return MakeError(ErrorCode::kInvalidArgument,
                     "disk_cache: {} cannot be made: {}; name a directory that the server may write to",
                     options.directory.string(), failed.message());
  }
  const Result<int> lock = LockDirectory(options.directory);
  if (!lock) return tl::unexpected(lock.error());
  return std::shared_ptr<DiskCache>(new DiskCache(options, *lock));
}

DiskCache::DiskCache(const DiskCacheOptions& options, int lock) : lock_(lock) { OpenStores(options); }

// RocksDB as Debian builds it asserts, and so ends the process, on some damage to what it reads while it opens a store.
// The lock file counts openings that have not come to their end: after two, the stores are thrown away. Nothing else
// is: whoever names a directory in which other files lie must not lose them.
void DiskCache::OpenStores(const DiskCacheOptions& options) {
  constexpr off_t kMostUnfinished = 2;
  struct stat status {};
  off_t unfinished = fstat(lock_, &status) == 0 ? status.st_size : 0;
  const bool anew = unfinished >= kMostUnfinished;
  if (anew) {
    spdlog::warn("disk cache in {}: {} starts ended while it was opened; begun anew, check the disk",
                 options.directory.string(), unfinished);
    unfinished = 0;
  }
  SetSize(lock_, unfinished + 1);
  tiles_ = OpenStore(options, options.tile_bytes, kTiles, false, anew);  // compressed already, or refuse to be
  refinements_ = OpenStore(options, options.refinement_bytes, kRefinements, true, anew);
  SetSize(lock_, 0);
}

DiskCache::~DiskCache() {
  tiles_.reset();
  refinements_.reset();
  close(lock_);
}

std::optional<EncodedTile> DiskCache::FindTile(const CacheKey& key) {
  if (!tiles_) return std::nullopt;
  const std::string store_key = StoreKey(key);
  const std::optional<std::string> bytes = tiles_->Find(store_key);
  if (!bytes) return std::nullopt;
  Result<EncodedTile> tile = ParseTile(*bytes);
  if (!tile) {
    tiles_->Forget(store_key);
    return std::nullopt;
  }
  tile->from_disk = true;
  return *std::move(tile);
}

RefinedTilePtr DiskCache::FindRefinement(const RefinedTileKey& key) {
  if (!refinements_) return nullptr;
  const std::string store_key = StoreKey(key);
  const std::optional<std::string> bytes = refinements_->Find(store_key);
  if (!bytes) return nullptr;
  Result<RefinedTile> tile = ParseRefinedTile(*bytes);
  if (!tile) {
    refinements_->Forget(store_key);
    return nullptr;
  }
  return std::make_shared<const RefinedTile>(*std::move(tile));
}

void DiskCache::KeepTile(const CacheKey& key, TilePtr tile) {
  if (!tiles_) return;
  const std::size_t charge = BytesOf(*tile);
  tiles_->Keep(
      StoreKey(key), [tile = std::move(tile)] { return SerializeTile(*tile); }, charge);
}

void DiskCache::KeepRefinement(const RefinedTileKey& key, RefinedTilePtr tile) {
  if (!refinements_) return;
  const std::size_t charge = BytesOf(*tile);
  refinements_->Keep(
      StoreKey(key), [tile = std::move(tile)] { return SerializeRefinedTile(*tile); }, charge);
}

void DiskCache::Flush() {
  for (DiskStore* store : {tiles_.get(), refinements_.get()}) {
    if (store != nullptr) store->Flush();
  }
}

void DiskCache::Abandon() {
  for (DiskStore* store : {tiles_.get(), refinements_.get()}) {
    if (store != nullptr) store->Abandon();
  }
}

DiskCacheStats DiskCache::stats() const {
  DiskCacheStats stats;
  if (tiles_) stats.tiles = tiles_->stats();
  if (refinements_) stats.refinements = refinements_->stats();
  return stats;
}

}  // namespace terrace::server
