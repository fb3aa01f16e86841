// Voids of a raster that touch its rim: collars around the data, and voids cut by the raster's edge. All other voids
// are enclosed: they have data all around them. Voids that share a side form one region.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "engine/statistics/raster_chunk.h"

namespace terrace::dem {

// Immutable and thread-safe. A default-constructed object has no voids. Stores only rows that differ from the row
// above: collars and missing blocks, common in datasets of thousands of rasters, have few of these.
class RimVoids {
 public:
  // Samples first .. last of a row.
  struct Run {
    std::int32_t row, first, last;
    std::uint32_t region;

    friend bool operator==(const Run&, const Run&) = default;
  };

  RimVoids() = default;
  // Runs by row and column. Regions are numbered from 0.
  RimVoids(std::span<const Run> runs, std::uint32_t regions);
  // For a raster with too many runs to classify: all voids are one region that touches the rim.
  static RimVoids Everything();

  std::uint32_t regions() const { return regions_; }
  bool is_everything() const { return is_everything_; }
  bool has_runs() const { return !spans_.empty(); }
  std::vector<Run> Runs() const;
  // Memory of the runs. For tests.
  std::size_t bytes() const { return spans_.size() * sizeof(Span) + bands_.size() * sizeof(Band); }

  // The region of a void, or nothing for a hole. For a valid sample: nothing, or 0 if is_everything().
  std::optional<std::uint32_t> At(std::int64_t column, std::int64_t row) const { return StretchAt(column, row).region; }

  // The result of At, and how far it stays the same: along the row to last_column, along the column to last_row.
  struct Stretch {
    std::optional<std::uint32_t> region = {};
    std::int64_t last_column = std::numeric_limits<std::int64_t>::max(), last_row = last_column;
  };
  Stretch StretchAt(std::int64_t column, std::int64_t row) const;

 private:
  struct Span {
    std::int32_t first, last;
    std::uint32_t region;

    friend bool operator==(const Span&, const Span&) = default;
  };
  // All rows from this one up to the next band have the same spans, which end where those of the next band begin.
  struct Band {
    std::int32_t row;
    std::uint32_t first_span;
  };
  std::span<const Span> SpansOf(std::size_t band) const;
  void AddBand(std::int32_t row, std::span<const Run> runs);

  std::vector<Span> spans_;
  std::vector<Band> bands_;  // the last one, behind all runs, has no spans
  std::uint32_t regions_ = 0;
  bool is_everything_ = false;
};

// Finds the voids that touch the rim in one pass over the runs of all voids. Holds the runs of one row of chunks, of
// voids that touch the rim, and of voids that may still connect to the rim.
class RimVoidFinder {
 public:
  // Limit of stored runs, 16 bytes each. A raster that needs more becomes RimVoids::Everything.
  static constexpr std::size_t kMaxRuns = std::size_t{1} << 22;

  // `columns`: those in use. The first column is part of the rim even if the raster wraps around the Earth. Calls
  // `hole` for each run of a hole with row, first sample, last sample, and the number of samples of the hole.
  using Hole = std::function<void(std::int32_t, std::int32_t, std::int32_t, std::int64_t)>;
  RimVoidFinder(int columns, int rows, Hole hole, std::size_t max_runs = kMaxRuns);

  // Adds all chunks in the order of ChunkGrid.
  void Add(const Chunk& chunk, const ChunkStatistics& chunk_statistics);
  // Call after the last chunk.
  RimVoids Finish();

 private:
  using Run = RimVoids::Run;

  void AddRun(int chunk_row, std::int32_t first, std::int32_t last);
  void Sweep();  // the rows of a row of chunks
  void SweepRow(std::int32_t row, std::vector<Run>& runs);
  void Settle();  // regions that cannot reach the rim any more are holes
  void Renumber();
  void GiveUp();

  std::uint32_t NewRegion();
  std::uint32_t RootOf(std::uint32_t region);
  void Join(std::uint32_t a, std::uint32_t b);

  const int columns_, rows_;
  const Hole hole_;
  const std::size_t max_runs_;
  std::int32_t top_ = 0;                // first row of the current row of chunks
  std::vector<std::vector<Run>> band_;  // its runs, by row
  std::size_t band_runs_ = 0;
  std::vector<Run> frontier_;           // of the row above
  std::vector<Run> rim_, open_;         // runs that touch the rim; runs that may
  std::vector<std::uint32_t> parents_;  // of regions, up to their roots
  std::vector<std::uint8_t> touches_;   // of roots
  bool has_given_up_ = false;
};

}  // namespace terrace::dem
