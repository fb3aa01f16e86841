// The header and the directories of PMTiles version 3
// (https://github.com/protomaps/PMTiles/blob/main/spec/v3/spec.md). Decoding accepts any bytes.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "engine/common/dem_types.h"
#include "engine/core/result.h"

namespace terrace::archive {

inline constexpr std::size_t kHeaderBytes = 127;
// Header and root directory lie within the first 16 KiB, so that clients read both in one request.
inline constexpr std::size_t kHeadBytes = 16'384;

enum class PmtilesCompression : std::uint8_t { kUnknown, kNone, kGzip, kBrotli, kZstd };
enum class PmtilesType : std::uint8_t { kOther, kVector, kPng };

struct Section {
  std::uint64_t offset = 0, length = 0;

  std::uint64_t end() const { return offset + length; }
};

struct PmtilesHeader {
  Section root, metadata, leaves, data;
  std::uint64_t tiles = 0, entries = 0, contents = 0;
  PmtilesCompression tile_compression = PmtilesCompression::kNone;
  PmtilesType type = PmtilesType::kOther;
  int min_zoom = 0, max_zoom = 0;
  dem::GeoBounds bounds;        // west < east
  double center_longitude = 0;  // not always halfway: bounds across the antimeridian are those of the whole globe
};

std::string EncodeHeader(const PmtilesHeader& header);
// Accepts what EncodeHeader writes: the sections follow each other without gaps up to `file_bytes`. kInvalidArgument:
// anything else.
Result<PmtilesHeader> DecodeHeader(std::string_view bytes, std::uint64_t file_bytes);

struct DirectoryEntry {
  std::uint64_t tile_id = 0;
  std::uint64_t offset = 0;
  std::uint32_t length = 0;
  std::uint32_t run = 0;  // tiles with these bytes, from tile_id; 0: a leaf directory

  friend bool operator==(const DirectoryEntry&, const DirectoryEntry&) = default;
};

// Compressed. Precondition: at least one entry, in the order of their ids.
std::string EncodeDirectory(const std::vector<DirectoryEntry>& entries);
// More than the directories of 10^10 tiles have, which a writer divides so that the root fits into the head.
inline constexpr std::size_t kMaxDirectoryBytes = std::size_t{32} << 20;  // compressed or not
// Checks that ids rise, runs do not overlap, and lengths are above 0. Leaf directories (run 0) must lie within `leaves`
// bytes, tiles within `data` bytes. Memory is taken for at most `max_entries`. kInvalidArgument: there are more, or one
// of these does not hold.
Result<std::vector<DirectoryEntry>> DecodeDirectory(std::string_view compressed, std::uint64_t leaves,
                                                    std::uint64_t data, std::uint64_t max_entries);

}  // namespace terrace::archive
