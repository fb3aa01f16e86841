#include "archive/pmtiles/directory.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "engine/core/bytes.h"
#include "proto/compress.h"

namespace terrace::archive {
namespace {

constexpr std::string_view kMagic = "PMTiles\x03";

tl::unexpected<Error> BadHeader(const char* what) { return MakeError(ErrorCode::kInvalidArgument, "{}", what); }
tl::unexpected<Error> BadDirectory() { return MakeError(ErrorCode::kInvalidArgument, "a directory is damaged"); }

std::int32_t TenMillionths(double degrees) { return static_cast<std::int32_t>(std::lround(degrees * 1e7)); }

void PutVarint(ByteWriter& writer, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) writer.Put(static_cast<std::uint8_t>(value | 0x80));
  writer.Put(static_cast<std::uint8_t>(value));
}

class VarintReader {
 public:
  explicit VarintReader(std::string_view bytes) : bytes_(bytes) {}

  // 0 after an error.
  std::uint64_t Get() {
    std::uint64_t value = 0;
    for (int shift = 0; shift < 64; shift += 7) {
      if (at_ == bytes_.size()) break;
      const auto byte = static_cast<std::uint8_t>(bytes_[at_++]);
      const std::uint64_t bits = byte & 0x7fU;
      if (shift == 63 && bits > 1) break;
      value |= bits << shift;
      if (byte < 0x80) return value;
    }
    ok_ = false;
    return 0;
  }
  std::uint32_t Get32() {
    const std::uint64_t value = Get();
    ok_ = ok_ && value <= std::numeric_limits<std::uint32_t>::max();
    return static_cast<std::uint32_t>(value);
  }
  std::size_t remaining() const { return bytes_.size() - at_; }
  bool ok() const { return ok_; }

 private:
  std::string_view bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

bool IsValid(const std::vector<DirectoryEntry>& entries, std::uint64_t leaves, std::uint64_t data) {
  std::uint64_t free_id = 0;
  for (const DirectoryEntry& entry : entries) {
    const std::uint64_t section = entry.run == 0 ? leaves : data;
    if (entry.tile_id < free_id || entry.length == 0 || entry.length > section ||
        entry.offset > section - entry.length) {
      return false;
    }
    const std::uint64_t run = entry.run == 0 ? 1 : entry.run;
    if (entry.tile_id > std::numeric_limits<std::uint64_t>::max() - run) return false;
    free_id = entry.tile_id + run;
  }
  return true;
}

}  // namespace

std::string EncodeHeader(const PmtilesHeader& header) {
  ByteWriter writer;
  writer.Reserve(kHeaderBytes);
  writer.PutBytes(kMagic);
  for (const Section& section : {header.root, header.metadata, header.leaves, header.data}) {
    writer.Put(section.offset);
    writer.Put(section.length);
  }
  writer.Put(header.tiles);
  writer.Put(header.entries);
  writer.Put(header.contents);
  writer.Put<std::uint8_t>(1);  // clustered
  writer.Put(static_cast<std::uint8_t>(PmtilesCompression::kGzip));
  writer.Put(static_cast<std::uint8_t>(header.tile_compression));
  writer.Put(static_cast<std::uint8_t>(header.type));
  writer.Put(static_cast<std::uint8_t>(header.min_zoom));
  writer.Put(static_cast<std::uint8_t>(header.max_zoom));
  const dem::GeoBounds& bounds = header.bounds;
  for (const double degrees : {bounds.west, bounds.south, bounds.east, bounds.north})
    writer.Put(TenMillionths(degrees));
  writer.Put(static_cast<std::uint8_t>(header.min_zoom));
  writer.Put(TenMillionths(header.center_longitude));
  writer.Put(TenMillionths((bounds.south + bounds.north) / 2));
  return writer.Take();
}

Result<PmtilesHeader> DecodeHeader(std::string_view bytes, std::uint64_t file_bytes) {
  if (bytes.size() < kHeaderBytes || !bytes.starts_with(kMagic))
    return BadHeader("this is no PMTiles file of version 3");
  ByteReader reader(bytes.substr(kMagic.size(), kHeaderBytes - kMagic.size()));
  PmtilesHeader header;
  std::uint64_t end = kHeaderBytes;
  for (Section* section : {&header.root, &header.metadata, &header.leaves, &header.data}) {
    section->offset = reader.Get<std::uint64_t>();
    section->length = reader.Get<std::uint64_t>();
    if (section->offset != end || section->length > file_bytes || section->offset > file_bytes - section->length) {
      return BadHeader("its sections do not follow each other, or it is cut short");
    }
    end = section->end();
  }
  if (end != file_bytes) return BadHeader("it is cut short, or something was appended to it");
  if (header.root.end() > kHeadBytes) return BadHeader("its root directory is too large");
  header.tiles = reader.Get<std::uint64_t>();
  header.entries = reader.Get<std::uint64_t>();
  header.contents = reader.Get<std::uint64_t>();
  reader.Get<std::uint8_t>();
  if (reader.Get<std::uint8_t>() != static_cast<std::uint8_t>(PmtilesCompression::kGzip)) {
    return BadHeader("its directories are not compressed by gzip");
  }
  header.tile_compression = static_cast<PmtilesCompression>(reader.Get<std::uint8_t>());
  header.type = static_cast<PmtilesType>(reader.Get<std::uint8_t>());
  header.min_zoom = reader.Get<std::uint8_t>();
  header.max_zoom = reader.Get<std::uint8_t>();
  for (double* degrees : {&header.bounds.west, &header.bounds.south, &header.bounds.east, &header.bounds.north}) {
    *degrees = reader.Get<std::int32_t>() / 1e7;
  }
  reader.Get<std::uint8_t>();  // the zoom of the first view
  header.center_longitude = reader.Get<std::int32_t>() / 1e7;
  return header;
}

std::string EncodeDirectory(const std::vector<DirectoryEntry>& entries) {
  ByteWriter writer;
  PutVarint(writer, entries.size());
  std::uint64_t last_id = 0;
  for (const DirectoryEntry& entry : entries) {
    PutVarint(writer, entry.tile_id - last_id);
    last_id = entry.tile_id;
  }
  for (const DirectoryEntry& entry : entries) PutVarint(writer, entry.run);
  for (const DirectoryEntry& entry : entries) PutVarint(writer, entry.length);
  std::optional<std::uint64_t> next;  // where the entry before ends
  for (const DirectoryEntry& entry : entries) {
    PutVarint(writer, next == entry.offset ? 0 : entry.offset + 1);
    next = entry.offset + entry.length;
  }
  return proto::Gzip(writer.Take());
}

Result<std::vector<DirectoryEntry>> DecodeDirectory(std::string_view compressed, std::uint64_t leaves,
                                                    std::uint64_t data, std::uint64_t max_entries) {
  // Of the varints of an entry, and of the count.
  constexpr std::size_t kMinEntryBytes = 4, kMaxEntryBytes = 30, kMaxCountBytes = 10;
  max_entries = std::min<std::uint64_t>(max_entries, kMaxDirectoryBytes / kMinEntryBytes);
  const std::optional<std::string> bytes = proto::Gunzip(
      compressed, std::min<std::size_t>(kMaxDirectoryBytes, kMaxCountBytes + max_entries * kMaxEntryBytes));
  if (!bytes) return BadDirectory();
  VarintReader reader(*bytes);
  const std::uint64_t count = reader.Get();
  if (!reader.ok() || count == 0 || count > max_entries || count > reader.remaining() / kMinEntryBytes) {
    return BadDirectory();
  }
  std::vector<DirectoryEntry> entries(count);
  std::uint64_t last_id = 0;
  for (DirectoryEntry& entry : entries) {
    const std::uint64_t step = reader.Get();
    if (step > std::numeric_limits<std::uint64_t>::max() - last_id) return BadDirectory();
    last_id += step;
    entry.tile_id = last_id;
  }
  for (DirectoryEntry& entry : entries) entry.run = reader.Get32();
  for (DirectoryEntry& entry : entries) entry.length = reader.Get32();
  std::optional<std::uint64_t> next;
  for (DirectoryEntry& entry : entries) {
    const std::uint64_t offset = reader.Get();
    if (offset == 0 && !next) return BadDirectory();
    entry.offset = offset == 0 ? *next : offset - 1;
    if (entry.offset > std::numeric_limits<std::uint64_t>::max() - entry.length) return BadDirectory();
    next = entry.offset + entry.length;
  }
  if (!reader.ok() || reader.remaining() > 0 || !IsValid(entries, leaves, data)) return BadDirectory();
  return entries;
}

}  // namespace terrace::archive
