// Blocks of full-resolution samples with voids filled, as heights at single points need them, kept in memory.
//
// A block has 256 x 256 cells of four samples, counted from the north-western corner of its raster grid, with the
// samples on all its sides. Its values do not depend on how or when it was read.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "engine/common/lru_block_cache.h"
#include "engine/raster/grid_cells.h"

namespace terrace::dem {

inline constexpr std::int64_t kPointBlockCells = 256;  // per axis

struct PointBlock {
  GridWindow window;
  std::vector<float> bridged;   // metres in the source's datum; narrow voids are filled, NaN for the others
  std::vector<float> measured;  // before narrow voids were filled; empty: there are no voids
  std::vector<float> smooth;    // holes are filled as well; empty: there are no holes
  // Instead of `bridged`, where there are no voids: whole metres, or one height that all samples have, as on the sea.
  std::vector<std::int16_t> whole;
  std::optional<float> uniform_height;

  bool has_voids() const { return !measured.empty(); }
  // Moves samples into `whole` or `uniform_height`, if that is possible.
  void Compact();
  // Interpolate (raster/grid_cells.h) with narrow voids and holes filled.
  std::optional<double> HeightAt(const GridCell& cell) const;
  // All samples, with narrow voids and holes filled; with narrow voids alone filled.
  std::vector<float> Samples() const;
  std::vector<float> Bridged() const;
  std::size_t bytes() const {
    return (bridged.size() + measured.size() + smooth.size()) * sizeof(float) + whole.size() * sizeof(std::int16_t);
  }
};
using PointBlockPtr = std::shared_ptr<const PointBlock>;

// The position of a block in its grid. Rows of blocks count from 0. Columns count from 1: column 0 holds the cells west
// of the first column, which exist where columns wrap.
struct PointBlockKey {
  std::uint64_t grid = 0;  // RasterGrid's number in this process
  std::int64_t column = 0, row = 0;

  friend bool operator==(const PointBlockKey&, const PointBlockKey&) = default;
};

// The most recently used blocks of all raster grids of the process. Thread-safe.
class PointBlockCache {
 public:
  // Without voids: 500 blocks of whole metres, or 250 blocks of other heights (a raster of 4,000 x 4,000 floats), or
  // about 60,000 blocks of one height.
  static constexpr std::size_t kCapacityBytes = std::size_t{64} << 20;

  explicit PointBlockCache(std::size_t capacity_bytes = kCapacityBytes) : blocks_(capacity_bytes) {}
  static PointBlockCache& Shared();  // is never destroyed: worker threads may outlive static objects

  PointBlockPtr Find(const PointBlockKey& key) { return blocks_.Find(key); }  // null: not kept
  void Insert(const PointBlockKey& key, PointBlockPtr block);

  // Returns whether the block was noted by an earlier call, and notes it. A few notes may be lost: each replaces that
  // of another block with the same hash. A block that is wanted once, for a few points, is not worth reading as a
  // whole.
  bool Note(const PointBlockKey& key);

  std::size_t count() const { return blocks_.count(); }
  std::size_t bytes() const { return blocks_.bytes(); }

 private:
  struct Hash {
    std::size_t operator()(const PointBlockKey& key) const noexcept;
  };

  LruBlockCache<PointBlockKey, PointBlock, Hash> blocks_;
  std::mutex mutex_;
  std::vector<PointBlockKey> noted_;  // by hash
};

}  // namespace terrace::dem
