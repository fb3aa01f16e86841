#include "archive/pmtiles/pmtiles_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "proto/compress.h"

namespace terrace::archive {
namespace {

// The last entry that begins at or before the tile.
const DirectoryEntry* EntryFor(const std::vector<DirectoryEntry>& entries, std::uint64_t tile_id) {
  const auto after = std::ranges::upper_bound(entries, tile_id, {}, &DirectoryEntry::tile_id);
  return after == entries.begin() ? nullptr : &*std::prev(after);
}

}  // namespace

Error PmtilesFile::Damaged(const std::string& how) const {
  return {ErrorCode::kUnavailable, fmt::format("{} is damaged: {}; copy it again, or bake it again", path_, how)};
}

Result<std::unique_ptr<const PmtilesFile>> PmtilesFile::Open(const std::string& path, std::size_t max_metadata_bytes) {
  Result<std::unique_ptr<const InputFile>> input = InputFile::Open(path);
  if (!input) return tl::unexpected(std::move(input.error()));
  std::unique_ptr<PmtilesFile> file(new PmtilesFile(path, *std::move(input)));
  if (Result<void> read = file->ReadHead(max_metadata_bytes); !read) return tl::unexpected(std::move(read.error()));
  return file;
}

Result<void> PmtilesFile::ReadHead(std::size_t max_metadata_bytes) {
  const Result<std::string> head = file_->Read(0, std::min<std::uint64_t>(kHeadBytes, bytes()));
  if (!head) return tl::unexpected(head.error());
  const Result<PmtilesHeader> header = DecodeHeader(*head, bytes());
  if (!header) return tl::unexpected(Damaged(header.error().message));
  header_ = *header;
  Result<std::vector<DirectoryEntry>> root =
      DecodeDirectory(std::string_view(*head).substr(header_.root.offset, header_.root.length), header_.leaves.length,
                      header_.data.length, header_.leaves.length / kRowBytes);
  if (!root) return tl::unexpected(Damaged(root.error().message));
  root_ = *std::move(root);
  if (std::ranges::any_of(root_, [](const DirectoryEntry& entry) { return entry.run > 0; })) {
    return tl::unexpected(Damaged("its root directory names tiles, so that another program wrote it"));
  }
  if (header_.metadata.length > max_metadata_bytes) return tl::unexpected(Damaged("its metadata is too long"));
  const Result<std::string> metadata = file_->Read(header_.metadata.offset, header_.metadata.length);
  if (!metadata) return tl::unexpected(metadata.error());
  std::optional<std::string> json = proto::Gunzip(*metadata, max_metadata_bytes);
  if (!json) return tl::unexpected(Damaged("its metadata cannot be decompressed"));
  metadata_ = *std::move(json);
  return {};
}

Result<PmtilesFile::LeafPtr> PmtilesFile::ReadLeaf(const DirectoryEntry& leaf) const {
  auto made = std::make_shared<Leaf>();
  made->rows_at = header_.leaves.offset + leaf.offset + leaf.length;
  const std::uint64_t max_rows = (header_.leaves.end() - made->rows_at) / kRowBytes;
  if (leaf.length > kMaxDirectoryBytes) return tl::unexpected(Damaged("a directory is too long"));
  const Result<std::string> bytes = file_->Read(header_.leaves.offset + leaf.offset, leaf.length);
  if (!bytes) return tl::unexpected(bytes.error());
  // An entry has a row for each of its tiles.
  Result<std::vector<DirectoryEntry>> entries =
      DecodeDirectory(*bytes, header_.leaves.length, header_.data.length, max_rows);
  if (!entries) return tl::unexpected(Damaged(entries.error().message));
  std::uint64_t rows = 0;
  for (const DirectoryEntry& entry : *entries) {
    made->rows_before.push_back(rows);
    rows += entry.run;
    // A leaf in a leaf could be a cycle.
    if (entry.run == 0 || rows > max_rows) return tl::unexpected(Damaged("a directory is not one of terrace"));
  }
  if (entries->front().tile_id != leaf.tile_id) return tl::unexpected(Damaged("a directory is at a wrong place"));
  made->entries = *std::move(entries);
  return LeafPtr(std::move(made));
}

Result<PmtilesFile::LeafPtr> PmtilesFile::FindLeaf(const DirectoryEntry& leaf) const {
  if (LeafPtr known = recent_.Find(leaf.offset)) return known;
  Result<LeafPtr> read = ReadLeaf(leaf);  // several threads may read it: no harm
  if (read) recent_.Insert(leaf.offset, *read, 1);
  return read;
}

Result<ArchivedTile> PmtilesFile::ReadTile(const Leaf& leaf, std::size_t entry, std::uint64_t tile_id) const {
  const DirectoryEntry& found = leaf.entries[entry];
  const std::uint64_t row_number = leaf.rows_before[entry] + (tile_id - found.tile_id);
  const Result<std::string> row = file_->Read(leaf.rows_at + row_number * kRowBytes, kRowBytes);
  if (!row) return tl::unexpected(row.error());
  Result<std::string> bytes = file_->Read(header_.data.offset + found.offset, found.length);
  if (!bytes) return tl::unexpected(std::move(bytes.error()));
  std::optional<ArchivedTile> tile = DecodeRow(tile_id, *row, *std::move(bytes));
  if (!tile) return tl::unexpected(Damaged(fmt::format("the checksum of tile {} is wrong", tile_id)));
  return *std::move(tile);
}

Result<std::optional<ArchivedTile>> PmtilesFile::Find(std::uint64_t tile_id) const {
  const DirectoryEntry* const in_root = EntryFor(root_, tile_id);
  if (in_root == nullptr) return std::nullopt;
  const Result<LeafPtr> leaf = FindLeaf(*in_root);
  if (!leaf) return tl::unexpected(leaf.error());
  const DirectoryEntry* const entry = EntryFor((*leaf)->entries, tile_id);
  if (entry == nullptr || tile_id - entry->tile_id >= entry->run) return std::nullopt;
  Result<ArchivedTile> tile = ReadTile(**leaf, static_cast<std::size_t>(entry - (*leaf)->entries.data()), tile_id);
  if (!tile) return tl::unexpected(std::move(tile.error()));
  return *std::move(tile);
}

Result<void> PmtilesFile::ForEach(const Take& take) const {
  std::uint64_t tiles = 0;
  for (const DirectoryEntry& in_root : root_) {
    const Result<LeafPtr> leaf = ReadLeaf(in_root);
    if (!leaf) return tl::unexpected(leaf.error());
    for (std::size_t i = 0; i < (*leaf)->entries.size(); ++i) {
      const DirectoryEntry& entry = (*leaf)->entries[i];
      for (std::uint32_t k = 0; k < entry.run; ++k) {
        Result<ArchivedTile> tile = ReadTile(**leaf, i, entry.tile_id + k);
        if (!tile) return tl::unexpected(std::move(tile.error()));
        if (Result<void> taken = take(entry.tile_id + k, *std::move(tile)); !taken) return taken;
        ++tiles;
      }
    }
  }
  if (tiles != header_.tiles) return tl::unexpected(Damaged("its header counts other tiles than its directories have"));
  return {};
}

}  // namespace terrace::archive
