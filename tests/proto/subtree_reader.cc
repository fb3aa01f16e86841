#include "tests/proto/subtree_reader.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "engine/core/bytes.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::json;

tl::unexpected<Error> Bad(const char* what) { return MakeError(ErrorCode::kInvalidArgument, "{}", what); }

// The bytes of a buffer view of the binary chunk.
Result<std::string_view> ViewOf(const Json& json, std::size_t index, std::string_view binary) {
  const Json views = json.value("bufferViews", Json::array());
  if (index >= views.size()) return Bad("no such buffer view");
  const std::size_t offset = views[index].at("byteOffset"), length = views[index].at("byteLength");
  if (views[index].at("buffer") != 0) return Bad("a buffer outside the file");
  if (offset % 8 != 0) return Bad("a buffer view off its alignment");
  if (length == 0 || offset > binary.size() || binary.size() - offset < length) return Bad("a buffer view outside");
  return binary.substr(offset, length);
}

Result<BitList> ReadBits(const Json& json, const Json& availability, std::size_t count, std::string_view binary) {
  if (availability.contains("constant") == availability.contains("bitstream")) return Bad("neither constant nor bits");
  if (availability.contains("constant")) {
    const int constant = availability.at("constant");
    if (constant != 0 && constant != 1) return Bad("a constant that is no bit");
    return BitList(count, constant == 1);
  }
  const Result<std::string_view> bytes = ViewOf(json, availability.at("bitstream").get<std::size_t>(), binary);
  if (!bytes) return tl::unexpected(bytes.error());
  if (bytes->size() != (count + 7) / 8) return Bad("a bitstream of another length");
  BitList bits;
  for (std::size_t i = 0; i < bytes->size() * 8; ++i) {
    const bool bit = (static_cast<unsigned char>((*bytes)[i / 8]) >> (i % 8) & 1) != 0;
    if (i < count) bits.push_back(bit);
    if (i >= count && bit) return Bad("a bit after the last one");
  }
  if (availability.value("availableCount", -1) != std::count(bits.begin(), bits.end(), true)) {
    return Bad("availableCount does not fit");
  }
  return bits;
}

// The first bit of a level: the sum of 4^k for all k below it.
std::size_t LevelStart(int level) {
  std::size_t start = 0;
  for (int k = 0; k < level; ++k) start += std::size_t{1} << (2 * k);
  return start;
}

bool ParentsExist(const ReadSubtree& subtree, int levels) {
  for (int level = 1; level <= levels; ++level) {
    const std::size_t count = std::size_t{1} << (2 * level), start = LevelStart(level), above = LevelStart(level - 1);
    for (std::size_t i = 0; i < count; ++i) {
      const bool here = level < levels ? subtree.tiles[start + i] : subtree.children[i];
      if (here && !subtree.tiles[above + i / 4]) return false;
    }
  }
  return true;
}

// A property of the only table, row by row, assigned to the bits of the tiles.
Result<std::vector<float>> ReadProperty(const Json& json, const char* name, const BitList& tiles,
                                        std::string_view binary) {
  const Json& tables = json.at("propertyTables");
  if (tables.size() != 1 || json.at("tileMetadata") != 0 || tables[0].at("class") != "tile") return Bad("the table");
  const std::ptrdiff_t count = std::count(tiles.begin(), tiles.end(), true);
  if (tables[0].at("count") != count) return Bad("rows that do not fit the tiles");
  const Result<std::string_view> bytes =
      ViewOf(json, tables[0].at("properties").at(name).at("values").get<std::size_t>(), binary);
  if (!bytes) return tl::unexpected(bytes.error());
  if (bytes->size() != sizeof(float) * static_cast<std::size_t>(count)) return Bad("a column of another length");
  ByteReader in(*bytes);
  std::vector<float> values;
  for (const bool there : tiles) values.push_back(there ? in.Get<float>() : std::numeric_limits<float>::quiet_NaN());
  return values;
}

Result<void> ReadHeights(const Json& json, std::string_view binary, ReadSubtree& subtree) {
  if (!json.contains("propertyTables")) return {};
  const std::pair<const char*, std::vector<float>*> columns[] = {{"min_height", &subtree.min_heights},
                                                                 {"max_height", &subtree.max_heights}};
  for (const auto& [name, to] : columns) {
    Result<std::vector<float>> values = ReadProperty(json, name, subtree.tiles, binary);
    if (!values) return tl::unexpected(values.error());
    *to = std::move(*values);
  }
  return {};
}

Result<ReadSubtree> ReadChunks(const Json& json, std::string_view binary, int levels) {
  const Json buffers = json.value("buffers", Json::array());
  const std::size_t stated = buffers.empty() ? 0 : buffers.at(0).at("byteLength").get<std::size_t>();
  if (buffers.size() > 1 || stated > binary.size() || binary.size() - stated >= 8) return Bad("the buffer's length");
  const std::size_t count = LevelStart(levels), child_count = std::size_t{1} << (2 * levels);
  ReadSubtree subtree;
  if (!json.at("contentAvailability").is_array() || json.at("contentAvailability").size() != 1) {
    return Bad("contentAvailability is no array of one");
  }
  const std::pair<const Json*, BitList*> lists[] = {{&json.at("tileAvailability"), &subtree.tiles},
                                                    {&json.at("contentAvailability").at(0), &subtree.contents},
                                                    {&json.at("childSubtreeAvailability"), &subtree.children}};
  for (const auto& [availability, to] : lists) {
    Result<BitList> bits = ReadBits(json, *availability, to == &subtree.children ? child_count : count, binary);
    if (!bits) return tl::unexpected(bits.error());
    *to = std::move(*bits);
  }
  subtree.tiles_constant = json.at("tileAvailability").contains("constant");
  subtree.children_constant = json.at("childSubtreeAvailability").contains("constant");
  if (!subtree.tiles[0]) return Bad("the subtree's root is not available");
  if (!ParentsExist(subtree, levels)) return Bad("a tile without its parent");
  if (const Result<void> heights = ReadHeights(json, binary, subtree); !heights) {
    return tl::unexpected(heights.error());
  }
  subtree.json = json.dump();
  return subtree;
}

}  // namespace

Result<ReadSubtree> ParseSubtree(std::string_view file, int levels) {
  ByteReader in(file);
  if (in.GetBytes(4) != "subt") return Bad("no magic number");
  const auto version = in.Get<std::uint32_t>();
  const auto json_bytes = in.Get<std::uint64_t>(), binary_bytes = in.Get<std::uint64_t>();
  if (!in.ok() || version != 1) return Bad("the header");
  if (json_bytes % 8 != 0 || binary_bytes % 8 != 0) return Bad("a chunk that is not padded");
  if (json_bytes > in.remaining() || in.remaining() - json_bytes != binary_bytes) return Bad("the lengths of chunks");
  const Json json = Json::parse(in.GetBytes(json_bytes), nullptr, /*allow_exceptions=*/false);
  if (json.is_discarded()) return Bad("the JSON chunk");
  try {
    return ReadChunks(json, in.GetBytes(binary_bytes), levels);
  } catch (const Json::exception& error) {
    return Bad(error.what());
  }
}

}  // namespace terrace::proto
