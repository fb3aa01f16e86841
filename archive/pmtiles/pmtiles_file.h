// Reads PMTiles files that PmtilesWriter wrote. Files of other programs give an error, damaged ones an error or the
// right tile. Checksums are no signatures: whoever can write the file can make it say anything. Thread-safe.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "archive/files/input_file.h"
#include "archive/pmtiles/directory.h"
#include "archive/pmtiles/tile_row.h"
#include "engine/common/lru_block_cache.h"
#include "engine/core/result.h"

namespace terrace::archive {

class PmtilesFile {
 public:
  // Errors of InputFile::Open. kUnavailable: the file is damaged. Messages name it.
  static Result<std::unique_ptr<const PmtilesFile>> Open(const std::string& path,
                                                         std::size_t max_metadata_bytes = std::size_t{64} << 20);

  const PmtilesHeader& header() const { return header_; }
  std::uint64_t bytes() const { return file_->size(); }
  const std::string& metadata() const { return metadata_; }  // JSON

  // Nothing: the file does not have the tile. kUnavailable: it is damaged or cannot be read.
  Result<std::optional<ArchivedTile>> Find(std::uint64_t tile_id) const;

  // Calls `take` for each tile in order, until it fails. Reads and checks every byte.
  using Take = std::function<Result<void>(std::uint64_t tile_id, ArchivedTile tile)>;
  Result<void> ForEach(const Take& take) const;

 private:
  // A directory of tiles, with the number of rows before each entry.
  struct Leaf {
    std::uint64_t rows_at = 0;  // in the file
    std::vector<DirectoryEntry> entries;
    std::vector<std::uint64_t> rows_before;
  };
  using LeafPtr = std::shared_ptr<const Leaf>;

  PmtilesFile(std::string path, std::unique_ptr<const InputFile> file)
      : path_(std::move(path)), file_(std::move(file)) {}
  Result<void> ReadHead(std::size_t max_metadata_bytes);
  Result<LeafPtr> ReadLeaf(const DirectoryEntry& leaf) const;
  Result<LeafPtr> FindLeaf(const DirectoryEntry& leaf) const;
  Result<ArchivedTile> ReadTile(const Leaf& leaf, std::size_t entry, std::uint64_t tile_id) const;
  Error Damaged(const std::string& how) const;

  const std::string path_;
  const std::unique_ptr<const InputFile> file_;
  PmtilesHeader header_;
  std::string metadata_;
  std::vector<DirectoryEntry> root_;
  mutable dem::LruBlockCache<std::uint64_t, Leaf> recent_{8};  // leaves by offset; counts leaves instead of bytes
};

}  // namespace terrace::archive
