#include "archive/pmtiles/tile_row.h"

#include <xxhash.h>

#include <cmath>
#include <limits>
#include <utility>

#include "engine/core/bytes.h"

namespace terrace::archive {
namespace {

std::uint64_t Checksum(std::uint64_t tile_id, std::string_view facts, std::string_view bytes) {
  const std::uint64_t seed = XXH3_64bits_withSeed(facts.data(), facts.size(), tile_id);
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), seed);
}

}  // namespace

std::string EncodeRow(std::uint64_t tile_id, const tiler::EncodedTile& tile, const dem::HeightRange& range) {
  ByteWriter facts;
  facts.Put(tile.max_error_m);
  facts.Put(tile.certified_error_m.value_or(std::numeric_limits<double>::quiet_NaN()));
  facts.Put(range.min);
  facts.Put(range.max);
  facts.Put(tile.vertices);
  facts.Put(tile.triangles);
  const std::string text = facts.Take();
  ByteWriter row;
  row.Put(Checksum(tile_id, text, tile.bytes));
  row.PutBytes(text);
  return row.Take();
}

std::optional<ArchivedTile> DecodeRow(std::uint64_t tile_id, std::string_view row, std::string bytes) {
  ByteReader reader(row);
  const auto checksum = reader.Get<std::uint64_t>();
  if (row.size() != kRowBytes || checksum != Checksum(tile_id, row.substr(sizeof(checksum)), bytes))
    return std::nullopt;
  ArchivedTile checked;
  tiler::EncodedTile& tile = checked.tile;
  tile.max_error_m = reader.Get<double>();
  const auto certified_error_m = reader.Get<double>();
  if (!std::isnan(certified_error_m)) tile.certified_error_m = certified_error_m;
  checked.range.min = reader.Get<double>();
  checked.range.max = reader.Get<double>();
  tile.vertices = reader.Get<std::uint32_t>();
  tile.triangles = reader.Get<std::uint32_t>();
  tile.bytes = std::move(bytes);
  return checked;
}

}  // namespace terrace::archive
