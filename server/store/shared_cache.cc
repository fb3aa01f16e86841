#include "server/store/shared_cache.h"

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <optional>
#include <string>
#include <string_view>
#include <thread>
#include <utility>

#include "server/store/look_up_gate.h"
#include "server/store/password_file.h"
#include "server/store/shared_store.h"
#include "tiler/store/tile_record.h"
#include "tiler/tile/build_id.h"

namespace terrace::server {
namespace {

// The variable of the environment with the password, if there is no file with it.
constexpr const char* kSharedCachePassword = "TERRACE_SHARED_CACHE_PASSWORD";

using std::chrono::milliseconds;

// What the keys of this program's tiles begin with.
std::string Prefix() {
  const std::uint64_t version = tiler::BuildId();
  return {reinterpret_cast<const char*>(&version), sizeof(version)};
}

// Tiles of one level and format take about the same time to build.
std::size_t ClassOf(const tiler::TileRequest& request) {
  constexpr std::size_t kLevels = 32;
  static_assert(static_cast<std::size_t>(tiler::TileFormat::kGeodeticImagery) < LookUpGate::kClasses / kLevels);
  const auto level = static_cast<std::size_t>(std::clamp(request.key.level, 0, static_cast<int>(kLevels) - 1));
  return level + kLevels * static_cast<std::size_t>(request.format);
}

class SharedCache final : public tiler::TileStore {
 public:
  SharedCache(const config::SharedCacheConfig& config, SharedStoreOptions options)
      : min_build_(static_cast<std::int64_t>(config.min_build_ms * 1000)),
        max_bytes_(config.max_bytes_per_tile),
        lease_(config.lease_ms),
        tier_(std::move(options)) {}

  const char* name() const override { return "shared"; }
  void Abandon() override {
    is_abandoned_ = true;
    tier_.Abandon();
  }

  tiler::StoreStats stats() const override {
    tiler::StoreStats stats = tier_.stats();
    stats.skipped += not_asked_;
    return stats;
  }

  Result<std::size_t> Erase(const tiler::TileSelection& selection, const std::stop_token& stop) override {
    const std::string program = Prefix();
    const auto is_chosen = [&](std::string_view key) {
      return tiler::IsSelected(selection, key.substr(program.size()));
    };
    // One prefix for all levels: Redis examines all of its keys for each.
    return tier_.Erase(program + tiler::RecordPrefix(selection.generation), is_chosen, stop);
  }

  std::optional<tiler::EncodedTile> Find(const tiler::CacheKey& key) override {
    const std::size_t kind = ClassOf(key.request);
    if (lease_.count() == 0 && !gate_.ShouldLookUp(kind)) {
      ++not_asked_;
      return std::nullopt;
    }
    const std::string record_key = Prefix() + tiler::RecordKey(key);
    std::optional<tiler::EncodedTile> tile = Read(record_key);
    if (!tile && lease_.count() > 0) tile = AwaitOther(record_key);
    gate_.Note(kind, tile.has_value());
    return tile;
  }

  // Tiles from a tier below would have no times, but no tier is below.
  void Insert(const tiler::CacheKey& key, std::shared_ptr<const tiler::EncodedTile> tile) override {
    const tiler::StageTimes& times = tile->times;
    const auto build = times.read + times.refine + times.encode + times.compress;
    const bool is_kept = build >= min_build_ && tile->bytes.size() <= max_bytes_;
    if (!is_kept && lease_.count() == 0) return;
    std::string record_key = Prefix() + tiler::RecordKey(key);
    const std::string leased = lease_.count() > 0 ? record_key : std::string();
    if (is_kept) {
      const std::size_t charge = tile->bytes.size() + sizeof(tiler::EncodedTile);
      tier_.Keep(
          std::move(record_key), [tile = std::move(tile)] { return tiler::SerializeTile(*tile); }, charge);
    }
    if (!leased.empty()) tier_.Release(leased);  // after the value
  }

  void GiveUp(const tiler::CacheKey& key) override {
    if (lease_.count() > 0) tier_.Release(Prefix() + tiler::RecordKey(key));
  }

  // Bytes of a value in addition to the tile's.
  static constexpr std::size_t kRecordBytes = 512;
  static constexpr int kLeasesOff = 10;  // lease times

 private:
  std::optional<tiler::EncodedTile> Read(const std::string& record_key) {
    const std::optional<std::string> bytes = tier_.Find(record_key);
    if (!bytes) return std::nullopt;
    Result<tiler::EncodedTile> tile = tiler::ParseTile(*bytes);
    if (tile) return *std::move(tile);
    tier_.Forget(record_key);
    return std::nullopt;
  }

  // If another server builds the tile, waits for it, at most for the time of a lease. Returns nothing if this server is
  // to build it. After a wait in vain, this server takes no leases for ten lease times. Otherwise, if every lease seems
  // held, it would wait once for each tile.
  std::optional<tiler::EncodedTile> AwaitOther(const std::string& record_key) {
    using Clock = std::chrono::steady_clock;
    if (Clock::now().time_since_epoch().count() < no_leases_until_) return std::nullopt;
    const auto end = Clock::now() + lease_;
    milliseconds pause{1};
    while (true) {
      const SharedStore::Lease lease = tier_.Take(record_key, lease_);
      if (lease == SharedStore::Lease::kNone) return std::nullopt;
      if (lease == SharedStore::Lease::kTaken) {
        // The last owner of the lease may have written the tile since the look-up.
        std::optional<tiler::EncodedTile> tile = Read(record_key);
        if (tile) tier_.Release(record_key);
        return tile;
      }
      if (is_abandoned_) return std::nullopt;
      if (Clock::now() + pause >= end) {
        no_leases_until_ = (Clock::now() + kLeasesOff * lease_).time_since_epoch().count();
        return std::nullopt;
      }
      std::this_thread::sleep_for(pause);
      pause = std::min(2 * pause, milliseconds(20));
      if (std::optional<tiler::EncodedTile> tile = Read(record_key)) return tile;
    }
  }

  const std::chrono::microseconds min_build_;
  const std::size_t max_bytes_;
  const milliseconds lease_;
  LookUpGate gate_;
  std::atomic<std::uint64_t> not_asked_{0};
  std::atomic<bool> is_abandoned_{false};
  std::atomic<std::chrono::steady_clock::rep> no_leases_until_{
      std::chrono::steady_clock::time_point::min().time_since_epoch().count()};
  SharedStore tier_;
};

Result<SharedStoreOptions> OptionsOf(const config::SharedCacheConfig& config, std::size_t readers) {
  const auto unreadable = [](std::string_view what) {
    return MakeError(ErrorCode::kUnavailable, "shared_cache: {}", what);
  };
  Result<redis::Address> address = redis::ParseAddress(config.url);
  if (!address) return MakeError(ErrorCode::kInvalidArgument, "shared_cache: {}", address.error().message);
  if (!config.password_file.empty()) {
    Result<std::string> password = ReadPassword(config.password_file);
    if (!password) return unreadable(password.error().message);
    address->password = *std::move(password);
  } else if (const char* const password = std::getenv(kSharedCachePassword);
             password != nullptr) {  // NOLINT(concurrency-mt-unsafe): read before threads start
    address->password = password;
  }
  if (!config.ca_file.empty() && !std::ifstream(config.ca_file)) {
    return unreadable(fmt::format("{} cannot be read; it must have certificates in PEM", config.ca_file));
  }
  SharedStoreOptions options;
  options.address = *std::move(address);
  options.ca_file = config.ca_file;
  options.timeout = milliseconds(config.timeout_ms);
  options.ttl = std::chrono::ceil<std::chrono::seconds>(config.ttl);
  options.max_value_bytes = config.max_bytes_per_tile + SharedCache::kRecordBytes;
  options.readers = readers;
  return options;
}

}  // namespace

Result<void> CheckSharedCache(const config::SharedCacheConfig& config) {
  const Result<SharedStoreOptions> options = OptionsOf(config, 1);
  if (!options) return tl::unexpected(options.error());
  return {};
}

Result<std::shared_ptr<tiler::TileStore>> OpenSharedCache(const config::SharedCacheConfig& config,
                                                          std::size_t readers) {
  Result<SharedStoreOptions> options = OptionsOf(config, readers);
  if (!options) return tl::unexpected(options.error());
  return std::make_shared<SharedCache>(config, *std::move(options));
}

}  // namespace terrace::server
