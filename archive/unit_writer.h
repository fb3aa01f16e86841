// Writes one unit of an archive: one PMTiles file.
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "archive/pmtiles/file_summary.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/tile_key.h"
#include "tiler/tile/encoded_tile.h"
#include "tiler/tile/tile_request.h"

namespace terrace::archive {

// Used by one thread at a time. The same tiles make the same bytes, in whatever order they were added.
// Destroyed without Finish: removes what it wrote. A process that is killed leaves files that end with ".partial",
// which readers ignore, and which bake::TidyPlace removes when all is done.
class UnitWriter {
 public:
  virtual ~UnitWriter() = default;

  // `tile`: in the coding of the archive's kind. Its bytes, errors and counts are stored. `range`:
  // ElevationModel::RangeBound of the tile; not used for height tiles. kInvalidArgument: the tile lies outside the
  // unit. kUnavailable: the disk cannot be written, for example because it is full.
  virtual Result<void> Add(const geo::TileKey& key, const tiler::EncodedTile& tile, const dem::HeightRange& range) = 0;

  // Writes the file and renames it. Call it once, last; the file is complete and on the disk afterwards. Without tiles
  // no file is written, and an old one is removed. kUnavailable: as Add.
  // kInvalidArgument: a tile was added twice.
  virtual Result<FileSummary> Finish() = 0;
};

struct UnitOptions {
  tiler::TileRequest kind;  // Manifest::kind
  std::uint64_t key = 0;    // UnitEntry::key; kept in the file
};

// Creates place/UnitPath(name), and its folders. Tiles wait in an unnamed file in the folder of the target, or in
// TMPDIR if the place is a bucket (SpoolFile); memory holds 80 bytes for each.
Result<std::unique_ptr<UnitWriter>> CreateUnit(const std::string& place, const std::string& name,
                                               const UnitOptions& options);

// Reads a finished file in full: every checksum, whether its tiles belong to the unit, and whether header and metadata
// are those that a writer with these options writes. A bake that continues uses it. kNotFound: no file.
// kInvalidArgument: the file is of another bake, or damaged: bake the unit again.
Result<FileSummary> VerifyUnit(const std::string& place, const std::string& name, const UnitOptions& options);

}  // namespace terrace::archive
