// The tier of the datasets' archives, asked before the disk cache.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <shared_mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "engine/core/result.h"
#include "tiler/store/baked_tiles.h"
#include "tiler/store/tile_selection.h"
#include "tiler/store/tile_store.h"
#include "tiler/tile_pipeline.h"

namespace terrace::server {

// Thread-safe. Keeps nothing itself: Insert does nothing.
class BakedStore final : public tiler::TileStore {
 public:
  // Uses the archives of these datasets from now on, and no others.
  void Use(const std::vector<tiler::Dataset>& datasets);
  // Until the next Use also uses these.
  void AlsoUse(const std::vector<tiler::Dataset>& datasets);

  const char* name() const override { return "archive"; }
  tiler::StoreStats stats() const override;
  // An archive is not a cache: nothing is erased.
  Result<std::size_t> Erase(const tiler::TileSelection&, const std::stop_token&) override { return std::size_t{0}; }
  void Abandon() override {}

  // Returns nothing also if a file is damaged. The log names each such fault once.
  std::optional<tiler::EncodedTile> Find(const tiler::CacheKey& key) override;
  void Insert(const tiler::CacheKey&, std::shared_ptr<const tiler::EncodedTile>) override {}

 private:
  struct Archive {
    std::shared_ptr<const tiler::BakedTiles> tiles;
    std::shared_ptr<const dem::ElevationModel> model;  // whose edits the tiles have; null: without sources
  };
  static std::multimap<std::uint64_t, Archive> ArchivesOf(const std::vector<tiler::Dataset>& datasets);
  void Report(const std::string& fault);

  mutable std::shared_mutex mutex_;
  std::multimap<std::uint64_t, Archive> baked_;  // by Dataset::cache_generation; guarded by mutex_
  std::set<std::string> reported_;               // guarded by mutex_
  std::atomic<std::uint64_t> hits_{0}, misses_{0}, errors_{0};
};

}  // namespace terrace::server
