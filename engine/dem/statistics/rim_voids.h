// Voids of a raster that touch its rim: collars around the data, and voids that the raster's edge cuts. All others are
// holes, with data all around them. Voids that share a side make one region.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "engine/dem/statistics/raster_chunk.h"

namespace terrace::dem {

// Immutable and thread-safe. By default there are none. Takes memory for rows that differ from the row above alone:
// collars and missing blocks, which thousands of rasters of a dataset may have, have few of these.
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
  // Of a raster whose voids are too ragged to be told apart: all of them are one region that touches the rim.
  static RimVoids Everything();

  std::uint32_t regions() const { return regions_; }
  bool is_everything() const { return is_everything_; }
  bool has_runs() const { return !spans_.empty(); }
  std::vector<Run> Runs() const;
  std::size_t bytes() const { return spans_.size() * sizeof(Span) + bands_.size() * sizeof(Band); }

  // The region of a void; none for a hole. Of a valid sample: none, or 0 where is_everything().
  std::optional<std::uint32_t> At(std::int64_t column, std::int64_t row) const { return StretchAt(column, row).region; }

  // What At says, and how far it says the same: along the row up to last_column, along the column up to last_row.
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
  // Rows from this one to that of the next band, which all have the spans up to those of the next band.
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

// Finds them while the statistics of a raster are read, in one pass over the runs of its voids. Memory: the runs of one
// row of parts, of voids that touch the rim, and of those that may still come to touch it.
class RimVoidFinder {
 public:
  // Runs that are kept, 16 bytes each; a raster that needs more is RimVoids::Everything.
  static constexpr std::size_t kMaxRuns = std::size_t{1} << 22;

  // Of the columns in use; the first column is at the rim even where the raster goes around the Earth. `hole` is told
  // the runs of holes: row, first and last sample, and how many samples the hole has.
  using Hole = std::function<void(std::int32_t, std::int32_t, std::int32_t, std::int64_t)>;
  RimVoidFinder(int columns, int rows, Hole hole, std::size_t most_runs = kMaxRuns);

  // All parts in the order of ChunkGrid.
  void Add(const Chunk& chunk, const ChunkStatistics& part);
  // After the last part.
  RimVoids Finish();

 private:
  using Run = RimVoids::Run;

  void AddRun(int chunk_row, std::int32_t first, std::int32_t last);
  void Sweep();  // the rows of a row of parts
  void SweepRow(std::int32_t row, std::vector<Run>& runs);
  void Settle();  // what cannot come to touch the rim any more is a hole
  void Renumber();
  void GiveUp();

  std::uint32_t NewRegion();
  std::uint32_t RootOf(std::uint32_t region);
  void Join(std::uint32_t a, std::uint32_t b);

  const int columns_, rows_;
  const Hole hole_;
  const std::size_t most_runs_;
  std::int32_t top_ = 0;                // first row of the row of parts at hand
  std::vector<std::vector<Run>> band_;  // its runs, by row
  std::size_t band_runs_ = 0;
  std::vector<Run> frontier_;           // of the row above
  std::vector<Run> rim_, open_;         // touch the rim; may come to
  std::vector<std::uint32_t> parents_;  // of regions, up to their roots
  std::vector<std::uint8_t> touches_;   // of roots
  bool has_given_up_ = false;
};

}  // namespace terrace::dem
