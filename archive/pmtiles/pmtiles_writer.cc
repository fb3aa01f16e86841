#include "archive/pmtiles/pmtiles_writer.h"

#include <fmt/format.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <tuple>
#include <utility>

#include "archive/pmtiles/tile_id.h"
#include "archive/pmtiles/tile_row.h"
#include "engine/core/check.h"
#include "proto/compress.h"

namespace terrace::archive {
namespace {

// Entries of a leaf directory. More, if the root directory would not fit into the head of the file.
constexpr std::size_t kLeafEntries = 4096;

int ZoomOf(std::uint64_t tile_id) { return KeyOf(tile_id).value_or(PmtilesKey{kMaxZoom, 0, 0}).zoom; }

struct Directories {
  std::string root;
  std::vector<std::string> leaves;
  std::vector<std::size_t> ends;  // of each leaf: the number of tiles in it and before it
  std::uint64_t leaf_bytes = 0;   // with the rows
};

Directories DivideBy(const std::vector<DirectoryEntry>& entries, std::size_t leaf_entries) {
  Directories made;
  std::vector<DirectoryEntry> root;
  std::size_t tiles = 0;
  for (std::size_t first = 0; first < entries.size(); first += leaf_entries) {
    const auto begin = entries.begin() + static_cast<std::ptrdiff_t>(first);
    const std::vector<DirectoryEntry> part(
        begin, begin + static_cast<std::ptrdiff_t>(std::min(leaf_entries, entries.size() - first)));
    std::string leaf = EncodeDirectory(part);
    std::size_t rows = 0;
    for (const DirectoryEntry& entry : part) rows += entry.run;
    root.push_back({part.front().tile_id, made.leaf_bytes, static_cast<std::uint32_t>(leaf.size()), 0});
    made.leaf_bytes += leaf.size() + rows * kRowBytes;
    tiles += rows;
    made.leaves.push_back(std::move(leaf));
    made.ends.push_back(tiles);
  }
  made.root = EncodeDirectory(root);
  return made;
}

Directories MakeDirectories(const std::vector<DirectoryEntry>& entries) {
  for (std::size_t leaf_entries = kLeafEntries;; leaf_entries += leaf_entries / 4) {
    Directories made = DivideBy(entries, leaf_entries);
    if (kHeaderBytes + made.root.size() < kHeadBytes) return made;
  }
}

}  // namespace

PmtilesWriter::PmtilesWriter(std::string path, const PmtilesOptions& options, SpoolFile spool)
    : path_(std::move(path)), options_(options), spool_(std::move(spool)) {}

Result<PmtilesWriter> PmtilesWriter::Create(const std::string& path, const PmtilesOptions& options) {
  Result<SpoolFile> spool = SpoolFile::Create(path);
  if (!spool) return tl::unexpected(std::move(spool.error()));
  return PmtilesWriter(path, options, *std::move(spool));
}

Result<void> PmtilesWriter::Add(std::uint64_t tile_id, const tiler::EncodedTile& tile, const dem::HeightRange& range) {
  if (tile.bytes.empty() || tile.bytes.size() > std::numeric_limits<std::uint32_t>::max()) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: a tile of {} bytes cannot be stored", path_, tile.bytes.size());
  }
  const XXH128_hash_t hash = XXH3_128bits(tile.bytes.data(), tile.bytes.size());
  const Result<std::uint64_t> spooled = spool_.Append(EncodeRow(tile_id, tile, range));
  if (!spooled) return tl::unexpected(spooled.error());
  if (const Result<std::uint64_t> bytes = spool_.Append(tile.bytes); !bytes) return tl::unexpected(bytes.error());
  waiting_.push_back({tile_id, *spooled, hash.high64, hash.low64, static_cast<std::uint32_t>(tile.bytes.size())});
  return {};
}

// Decides where the bytes of each tile lie: in the order of the tiles, equal bytes once. waiting_ is in order.
std::vector<std::uint64_t> PmtilesWriter::Place() {
  constexpr std::uint64_t kSame = ~std::uint64_t{0};
  std::vector<std::size_t> by_bytes(waiting_.size());
  std::iota(by_bytes.begin(), by_bytes.end(), std::size_t{0});
  const auto bytes_of = [this](std::size_t i) {
    return std::tie(waiting_[i].hash_high, waiting_[i].hash_low, waiting_[i].length);
  };
  std::ranges::sort(by_bytes, [&](std::size_t a, std::size_t b) {
    return std::tuple_cat(bytes_of(a), std::tie(a)) < std::tuple_cat(bytes_of(b), std::tie(b));
  });
  std::vector<std::uint64_t> offsets(waiting_.size(), 0);
  for (std::size_t i = 1; i < by_bytes.size(); ++i) {
    if (bytes_of(by_bytes[i]) == bytes_of(by_bytes[i - 1])) offsets[by_bytes[i]] = kSame;
  }
  data_bytes_ = contents_ = 0;
  for (std::size_t i = 0; i < offsets.size(); ++i) {
    if (offsets[i] == kSame) continue;
    offsets[i] = data_bytes_;
    data_bytes_ += waiting_[i].length;
    ++contents_;
  }
  for (std::size_t i = 1; i < by_bytes.size(); ++i) {
    if (offsets[by_bytes[i]] == kSame) offsets[by_bytes[i]] = offsets[by_bytes[i - 1]];
  }
  return offsets;
}

std::vector<DirectoryEntry> PmtilesWriter::Entries(const std::vector<std::uint64_t>& offsets) const {
  std::vector<DirectoryEntry> entries;
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    if (!entries.empty()) {
      DirectoryEntry& last = entries.back();
      if (last.offset == offsets[i] && last.tile_id + last.run == waiting_[i].tile_id) {
        ++last.run;
        continue;
      }
    }
    entries.push_back({waiting_[i].tile_id, offsets[i], waiting_[i].length, 1});
  }
  return entries;
}

Result<void> PmtilesWriter::WriteLeaves(OutputFile& out, const std::vector<std::string>& leaves,
                                        const std::vector<std::size_t>& ends) {
  std::size_t next = 0;
  for (std::size_t leaf = 0; leaf < leaves.size(); ++leaf) {
    if (Result<void> written = out.Write(leaves[leaf]); !written) return written;
    for (; next < ends[leaf]; ++next) {
      const Result<std::string> row = spool_.Read(waiting_[next].spooled, kRowBytes);
      if (!row) return tl::unexpected(row.error());
      if (Result<void> written = out.Write(*row); !written) return written;
    }
  }
  return {};
}

Result<void> PmtilesWriter::WriteTiles(OutputFile& out, const std::vector<std::uint64_t>& offsets) {
  std::uint64_t written_bytes = 0;
  for (std::size_t i = 0; i < waiting_.size(); ++i) {
    if (offsets[i] != written_bytes) continue;  // the same bytes as a tile before
    const Result<std::string> bytes = spool_.Read(waiting_[i].spooled + kRowBytes, waiting_[i].length);
    if (!bytes) return tl::unexpected(bytes.error());
    if (Result<void> written = out.Write(*bytes); !written) return written;
    written_bytes += bytes->size();
  }
  TERRACE_CHECK(written_bytes == data_bytes_);
  return {};
}

Result<FileSummary> PmtilesWriter::Finish(std::string_view metadata) {
  if (waiting_.empty()) {
    ::unlink(path_.c_str());
    return FileSummary{};
  }
  std::ranges::sort(waiting_, {}, &Waiting::tile_id);
  if (const auto twice = std::ranges::adjacent_find(waiting_, {}, &Waiting::tile_id); twice != waiting_.end()) {
    return MakeError(ErrorCode::kInvalidArgument, "{}: tile {} was added twice", path_, twice->tile_id);
  }
  const std::vector<std::uint64_t> offsets = Place();
  const std::vector<DirectoryEntry> entries = Entries(offsets);
  const Directories directories = MakeDirectories(entries);
  const std::string compressed = proto::Gzip(metadata);

  PmtilesHeader header;
  header.root = {kHeaderBytes, directories.root.size()};
  header.metadata = {header.root.end(), compressed.size()};
  header.leaves = {header.metadata.end(), directories.leaf_bytes};
  header.data = {header.leaves.end(), data_bytes_};
  header.tiles = waiting_.size();
  header.entries = entries.size();
  header.contents = contents_;
  header.tile_compression = options_.compression;
  header.type = options_.type;
  header.min_zoom = ZoomOf(waiting_.front().tile_id);
  header.max_zoom = ZoomOf(waiting_.back().tile_id);
  header.bounds = options_.bounds;
  header.center_longitude = options_.center_longitude.value_or((options_.bounds.west + options_.bounds.east) / 2);

  Result<OutputFile> out = OutputFile::Create(path_);
  if (!out) return tl::unexpected(std::move(out.error()));
  for (const std::string& part : {EncodeHeader(header), directories.root, compressed}) {
    if (Result<void> written = out->Write(part); !written) return tl::unexpected(std::move(written.error()));
  }
  if (Result<void> written = WriteLeaves(*out, directories.leaves, directories.ends); !written) {
    return tl::unexpected(std::move(written.error()));
  }
  if (Result<void> written = WriteTiles(*out, offsets); !written) return tl::unexpected(std::move(written.error()));
  if (Result<void> done = out->Finish(); !done) return tl::unexpected(std::move(done.error()));
  return FileSummary{waiting_.size(), out->size(), out->xxh3()};
}

}  // namespace terrace::archive
