#include "tiler/store/tile_record.h"

#include <xxhash.h>

#include <bit>
#include <cstring>
#include <utility>

#include "engine/core/bytes.h"

namespace terrace::tiler {
namespace {

// The value's hash is seeded with the key's. Their lengths are part of the hashes.
std::uint64_t Checksum(std::string_view key, std::string_view value) {
  return XXH3_64bits_withSeed(value.data(), value.size(), XXH3_64bits(key.data(), key.size()));
}

constexpr std::int32_t kMaxCells = 256;  // of geo::Lattice

tl::unexpected<Error> NotARecord() { return MakeError(ErrorCode::kInvalidArgument, "not a cache record"); }

void Put(ByteWriter& writer, const geo::TileKey& key) {
  const auto& [level, x, y] = key;
  writer.Put(static_cast<std::int32_t>(level));
  writer.Put(static_cast<std::int64_t>(x));
  writer.Put(static_cast<std::int64_t>(y));
}

void PutText(ByteWriter& writer, std::string_view text) {
  writer.Put(static_cast<std::uint32_t>(text.size()));
  writer.PutBytes(text);
}

std::string_view GetText(ByteReader& reader) {
  const auto size = reader.Get<std::uint32_t>();
  return reader.GetBytes(size);
}

}  // namespace

// All members are named, so that a new member fails to compile until it is added here: a key without it would find
// tiles of other requests.
std::string RecordKey(const CacheKey& key) {
  const auto& [request, generation, edits] = key;
  const auto& [dataset, tile, error_step, format, compression, texture, coding, extensions, height_encoding, side_px,
               map] = request;
  const auto& [normals, water_mask, metadata] = extensions;
  static_cast<void>(dataset);  // the generation identifies it
  ByteWriter writer;
  writer.Put(generation);
  Put(writer, tile);
  writer.Put(static_cast<std::int32_t>(error_step));
  writer.Put(static_cast<std::uint8_t>(format));
  writer.Put(static_cast<std::uint8_t>(compression));
  writer.Put(static_cast<std::uint8_t>(texture));
  writer.Put(static_cast<std::uint8_t>(coding));
  writer.Put(static_cast<std::uint8_t>(normals));
  writer.Put(static_cast<std::uint8_t>(water_mask));
  writer.Put(static_cast<std::uint8_t>(metadata));
  writer.Put(static_cast<std::uint8_t>(height_encoding));
  writer.Put(static_cast<std::int32_t>(side_px));
  if (IsMapLayer(format)) {
    const auto& [picture, azimuth_deg, altitude_deg, z_factor_hundredths, slope_style, interval_cm] = map;
    writer.Put(static_cast<std::uint8_t>(picture));
    writer.Put(azimuth_deg);
    writer.Put(altitude_deg);
    writer.Put(z_factor_hundredths);
    writer.Put(static_cast<std::uint8_t>(slope_style));
    writer.Put(interval_cm);
  }
  writer.Put(edits);
  return writer.Take();
}

std::string RecordKey(const RefinedTileKey& key) {
  ByteWriter writer;
  writer.Put(key.generation);
  Put(writer, key.key);
  if (key.edits != 0) writer.Put(key.edits);
  return writer.Take();
}

std::string RecordPrefix(std::uint64_t generation) {
  ByteWriter writer;
  writer.Put(generation);
  return writer.Take();
}

std::string RecordPrefix(std::uint64_t generation, int level) {
  ByteWriter writer;
  writer.Put(generation);
  writer.Put(static_cast<std::int32_t>(level));
  return writer.Take();
}

bool IsSelected(const TileSelection& selection, std::string_view record_key) {
  ByteReader reader(record_key);
  const auto generation = reader.Get<std::uint64_t>();
  geo::TileKey tile;
  tile.level = reader.Get<std::int32_t>();
  tile.x = reader.Get<std::int64_t>();
  tile.y = reader.Get<std::int64_t>();
  bool is_mercator = false;
  if (reader.remaining() > sizeof(std::uint64_t)) {  // the key of a tile
    reader.Get<std::int32_t>();
    is_mercator = IsMercator(static_cast<TileFormat>(reader.Get<std::uint8_t>()));
  }
  return reader.ok() && selection.Contains(generation, tile, is_mercator);
}

std::string SerializeTile(const EncodedTile& tile) {
  ByteWriter writer;
  writer.Reserve(tile.bytes.size() + tile.etag.size() + 32);
  writer.Put(tile.max_error_m);
  writer.Put<std::uint8_t>(tile.certified_error_m ? 1 : 0);
  writer.Put(tile.certified_error_m.value_or(0));
  writer.Put(tile.vertices);
  writer.Put(tile.triangles);
  PutText(writer, tile.etag);
  PutText(writer, tile.bytes);
  return writer.Take();
}

Result<EncodedTile> ParseTile(std::string_view bytes) {
  ByteReader reader(bytes);
  EncodedTile tile;
  tile.max_error_m = reader.Get<double>();
  const auto is_certified = reader.Get<std::uint8_t>();
  const auto certified_error_m = reader.Get<double>();
  // A tile has exactly one valid record.
  if (is_certified > 1 || (is_certified == 0 && std::bit_cast<std::uint64_t>(certified_error_m) != 0))
    return NotARecord();
  if (is_certified == 1) tile.certified_error_m = certified_error_m;
  tile.vertices = reader.Get<std::uint32_t>();
  tile.triangles = reader.Get<std::uint32_t>();
  tile.etag = GetText(reader);
  tile.bytes = GetText(reader);
  if (!reader.ok() || reader.remaining() > 0) return NotARecord();
  return tile;
}

std::string SerializeRefinedTile(const RefinedTile& tile) {
  const dem::TileHeights& heights = tile.heights;
  ByteWriter writer;
  writer.Reserve(heights.heights.size() * sizeof(float) + tile.refinement->bytes() + 64);
  writer.Put(tile.error_m);
  writer.Put(static_cast<std::int32_t>(heights.lattice.level));
  writer.Put(static_cast<std::int32_t>(heights.lattice.cells));
  writer.Put(static_cast<std::int32_t>(heights.stride));
  writer.Put(heights.source_error_m);
  PutText(writer, {reinterpret_cast<const char*>(heights.heights.data()), heights.heights.size() * sizeof(float)});
  PutText(writer, tile.refinement->Serialize());
  return writer.Take();
}

Result<RefinedTile> ParseRefinedTile(std::string_view bytes) {
  ByteReader reader(bytes);
  const auto error_m = reader.Get<double>();
  dem::TileHeights heights;
  heights.lattice.level = reader.Get<std::int32_t>();
  heights.lattice.cells = reader.Get<std::int32_t>();
  heights.stride = reader.Get<std::int32_t>();
  heights.source_error_m = reader.Get<double>();
  const std::string_view raw = GetText(reader);
  const std::string_view record = GetText(reader);
  if (!reader.ok() || reader.remaining() > 0) return NotARecord();
  if (heights.lattice.cells < 1 || heights.lattice.cells > kMaxCells) return NotARecord();
  const auto side = static_cast<std::size_t>(heights.lattice.cells) + 3;
  if (heights.stride != heights.lattice.cells + 3 || raw.size() != side * side * sizeof(float)) return NotARecord();
  heights.heights.resize(side * side);
  std::memcpy(heights.heights.data(), raw.data(), raw.size());
  Result<tin::Refinement> refinement = tin::Refinement::Parse(record);
  if (!refinement) return tl::unexpected(std::move(refinement).error());
  if (refinement->width() != heights.lattice.cells + 1 || refinement->height() != heights.lattice.cells + 1) {
    return NotARecord();
  }
  return RefinedTile{std::move(heights), *std::move(refinement), error_m};
}

std::string AddChecksum(std::string_view key, std::string value) {
  const std::uint64_t checksum = Checksum(key, value);
  value.append(reinterpret_cast<const char*>(&checksum), sizeof(checksum));
  return value;
}

std::optional<std::string_view> StripChecksum(std::string_view key, std::string_view sealed) {
  std::uint64_t checksum = 0;
  if (sealed.size() < sizeof(checksum)) return std::nullopt;
  const std::string_view value = sealed.substr(0, sealed.size() - sizeof(checksum));
  std::memcpy(&checksum, sealed.data() + value.size(), sizeof(checksum));
  if (checksum != Checksum(key, value)) return std::nullopt;
  return value;
}

}  // namespace terrace::tiler
