// Reads an archive. Hostile files are safe to read: every size is checked, every tile has a checksum.
//
// Thread-safe. Files of units are opened when they are needed, and stay open within the limit of all idle pools
// (engine/common/idle_pool.h). An archive in one file keeps it open.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/manifest.h"
#include "archive/pmtiles/tile_row.h"
#include "engine/common/dem_types.h"
#include "engine/core/result.h"
#include "engine/geo/tile_key.h"

namespace terrace::archive {

class Archive {
 public:
  // `place`: a folder with a manifest, or a file written by WriteSingle; also /vsis3/... where the source policy allows
  // it. kNotFound: nothing is there, or the bake is unfinished. kInvalidArgument: it is something else, or of a newer
  // format. kUnavailable: it cannot be read now. Messages name the place and the remedy.
  static Result<std::shared_ptr<const Archive>> Open(const std::string& place);
  // The archives of a place: one, or those of several formats, in the folders that FolderOf names. Errors: those of
  // Open.
  static Result<std::vector<std::shared_ptr<const Archive>>> OpenAll(const std::string& place);
  // The files by which a new archive at the place is noticed, because a bake replaces them last: the place itself, if
  // it is one file, and the manifests in it and in the folder of each format. Not all of them exist.
  static std::vector<std::string> FilesOf(const std::string& place);
  virtual ~Archive() = default;

  virtual const std::string& place() const = 0;
  virtual const Manifest& manifest() const = 0;

  // Nothing: the archive does not have the tile. kUnavailable: the tile's file is damaged, is not the one of this bake,
  // or cannot be read; the message names it.
  virtual Result<std::optional<ArchivedTile>> Find(const geo::TileKey& key) const = 0;

  // The range of a tile's heights in metres. Nothing and errors: as Find.
  virtual Result<std::optional<dem::HeightRange>> FindRange(const geo::TileKey& key) const = 0;

  // Whether files are missing, are not those of this archive any more, or cannot be read: the archive has to be opened
  // again. Missing files of folders are found when the archive is opened, the others by look-ups. Files in buckets are
  // not watched in another way.
  virtual bool is_outdated() const = 0;

  // Calls `take` for each tile, unit by unit, in the order of each unit's file. Ends when `take` fails. Reads and
  // checks every byte. Errors: those of `take` and of Find.
  using TakeTile = std::function<Result<void>(const geo::TileKey& key, ArchivedTile tile)>;
  virtual Result<void> ForEach(const TakeTile& take) const = 0;
};

}  // namespace terrace::archive
