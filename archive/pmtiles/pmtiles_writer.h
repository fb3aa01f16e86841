// Writes a PMTiles file: clustered, deduplicated, with a row of facts for each tile (tile_row.h) behind the leaf
// directory that names it. Other readers of PMTiles skip the rows.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "archive/files/output_file.h"
#include "archive/pmtiles/directory.h"
#include "archive/pmtiles/file_summary.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "tiler/tile/encoded_tile.h"

namespace terrace::archive {

struct PmtilesOptions {
  PmtilesCompression compression = PmtilesCompression::kNone;  // of the tiles
  PmtilesType type = PmtilesType::kOther;
  dem::GeoBounds bounds{-180, -90, 180, 90};    // west < east
  std::optional<double> center_longitude = {};  // default: the middle of `bounds`
};

// Used by one thread at a time. Tiles wait in a nameless file, so that they may come in any order.
class PmtilesWriter {
 public:
  static Result<PmtilesWriter> Create(const std::string& path, const PmtilesOptions& options);

  // kInvalidArgument: the tile is empty. kUnavailable: the disk cannot be written.
  Result<void> Add(std::uint64_t tile_id, const tiler::EncodedTile& tile, const dem::HeightRange& range);

  // `metadata`: JSON. Without tiles removes the file. kInvalidArgument: a tile was added twice.
  Result<FileSummary> Finish(std::string_view metadata);

 private:
  struct Waiting {
    std::uint64_t tile_id = 0, spooled = 0;     // its row, followed by its bytes
    std::uint64_t hash_high = 0, hash_low = 0;  // of the bytes
    std::uint32_t length = 0;
  };

  PmtilesWriter(std::string path, const PmtilesOptions& options, SpoolFile spool);
  std::vector<std::uint64_t> Place();
  std::vector<DirectoryEntry> Entries(const std::vector<std::uint64_t>& offsets) const;
  Result<void> WriteLeaves(OutputFile& out, const std::vector<std::string>& leaves,
                           const std::vector<std::size_t>& ends);
  Result<void> WriteTiles(OutputFile& out, const std::vector<std::uint64_t>& offsets);

  const std::string path_;
  const PmtilesOptions options_;
  SpoolFile spool_;
  std::vector<Waiting> waiting_;
  std::uint64_t data_bytes_ = 0, contents_ = 0;
};

}  // namespace terrace::archive
