#include "proto/documents/subtree.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

#include "engine/core/bytes.h"
#include "engine/core/check.h"

namespace terrace::proto {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kAlignment = 8;  // of both chunks and of every buffer view

// Number of bits of all levels above `level`: 1 + 4 + 16 + ...
constexpr std::size_t FirstBit(int level) { return ((std::size_t{1} << (2 * level)) - 1) / 3; }

class Bits {
 public:
  explicit Bits(std::size_t count) : count_(count), bytes_((count + 7) / 8, '\0') {}

  void Set(std::size_t bit) {
    bytes_[bit / 8] = static_cast<char>(bytes_[bit / 8] | 1 << bit % 8);
    ++set_;
  }
  // Sets the tiles of a level whose first bit is `first`.
  void Set(std::size_t first, const std::vector<geo::TileRange>& blocks) {
    for (const geo::TileRange& block : blocks) {
      for (std::int64_t y = block.start_y; y <= block.end_y; ++y) {
        for (std::int64_t x = block.start_x; x <= block.end_x; ++x) {
          Set(first + MortonIndex(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y)));
        }
      }
    }
  }
  bool uniform() const { return set_ == 0 || set_ == count_; }
  bool Has(std::size_t bit) const { return (bytes_[bit / 8] >> bit % 8 & 1) != 0; }
  std::size_t count() const { return count_; }
  std::size_t set() const { return set_; }
  const std::string& bytes() const { return bytes_; }

 private:
  std::size_t count_, set_ = 0;
  std::string bytes_;
};

// The binary chunk and the JSON that describes it.
class Buffer {
 public:
  // An availability object; its bitstream goes into the buffer unless all bits are equal.
  Json Add(const Bits& bits) {
    if (bits.uniform()) return {{"constant", bits.set() > 0 ? 1 : 0}};
    return {{"bitstream", AddView(bits.bytes())}, {"availableCount", bits.set()}};
  }
  // Returns the number of the buffer view.
  std::size_t AddView(std::string_view bytes) {
    views_.push_back({{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", bytes.size()}});
    bytes_.PutBytes(bytes);
    bytes_.PadTo(kAlignment);
    return views_.size() - 1;
  }
  void Describe(Json& json) const {
    if (views_.empty()) return;
    json["buffers"] = Json::array({{{"byteLength", bytes_.size()}}});
    json["bufferViews"] = views_;
  }
  std::string Take() { return bytes_.Take(); }

 private:
  Json views_ = Json::array();
  ByteWriter bytes_;
};

std::uint32_t EveryOther(std::uint32_t bits) {
  bits &= 0x55555555;
  bits = (bits | bits >> 1) & 0x33333333;
  bits = (bits | bits >> 2) & 0x0f0f0f0f;
  bits = (bits | bits >> 4) & 0x00ff00ff;
  return (bits | bits >> 8) & 0x0000ffff;
}

// One range per bit, undefined for bits that are not set. The children of the tile at bit i are at bits 4 i + 1 to 4 i
// + 4.
std::vector<HeightSpan> HeightsOf(const Subtree& subtree, const Bits& tiles) {
  std::vector<HeightSpan> heights(tiles.count());
  for (int level = subtree.levels - 1; level >= 0; --level) {
    for (std::size_t bit = FirstBit(level); bit < FirstBit(level + 1); ++bit) {
      if (!tiles.Has(bit)) continue;
      const auto morton = static_cast<std::uint32_t>(bit - FirstBit(level));
      heights[bit] = subtree.heights({level, EveryOther(morton), EveryOther(morton >> 1)});
      for (std::size_t child = 4 * bit + 1; child <= 4 * bit + 4 && child < tiles.count(); ++child) {
        if (tiles.Has(child)) heights[bit].Add(heights[child]);
      }
    }
  }
  return heights;
}

// The property table: a row for each available tile, in the order of their bits.
Json Table(const Subtree& subtree, const Bits& tiles, Buffer& buffer) {
  ByteWriter lowest, highest;
  const std::vector<HeightSpan> heights = HeightsOf(subtree, tiles);
  for (std::size_t bit = 0; bit < tiles.count(); ++bit) {
    if (!tiles.Has(bit)) continue;
    lowest.Put(static_cast<float>(heights[bit].min_m));
    highest.Put(static_cast<float>(heights[bit].max_m));
  }
  Json table = {{"class", kTileClass}, {"count", tiles.set()}};
  table["properties"][kMinHeightProperty]["values"] = buffer.AddView(lowest.Take());
  table["properties"][kMaxHeightProperty]["values"] = buffer.AddView(highest.Take());
  return table;
}

}  // namespace

std::uint32_t MortonIndex(std::uint32_t x, std::uint32_t y) {
  const auto spread = [](std::uint32_t bits) {
    bits = (bits | bits << 8) & 0x00ff00ff;
    bits = (bits | bits << 4) & 0x0f0f0f0f;
    bits = (bits | bits << 2) & 0x33333333;
    return (bits | bits << 1) & 0x55555555;
  };
  return spread(x) | spread(y) << 1;
}

std::string EncodeSubtree(const Subtree& subtree) {
  const auto levels = static_cast<std::size_t>(subtree.levels);
  TERRACE_CHECK(subtree.levels >= 1 && subtree.levels <= kMaxSubtreeLevels);
  TERRACE_CHECK(subtree.tiles.size() == levels + 1 && !subtree.tiles[0].empty());
  Bits tiles(FirstBit(subtree.levels)), children(std::size_t{1} << 2 * levels);
  for (int level = 0; level < subtree.levels; ++level) {
    tiles.Set(FirstBit(level), subtree.tiles[static_cast<std::size_t>(level)]);
  }
  children.Set(0, subtree.tiles[levels]);

  Buffer buffer;
  Json availability;
  availability["tileAvailability"] = buffer.Add(tiles);
  availability["contentAvailability"] = Json::array({availability["tileAvailability"]});
  availability["childSubtreeAvailability"] = buffer.Add(children);
  if (subtree.heights) {
    availability["propertyTables"] = Json::array({Table(subtree, tiles, buffer)});
    availability["tileMetadata"] = 0;
  }
  Json json = Json::object();
  buffer.Describe(json);
  json.update(availability);
  std::string text = json.dump();
  text.append((kAlignment - text.size() % kAlignment) % kAlignment, ' ');
  const std::string binary = buffer.Take();

  ByteWriter file;
  file.PutBytes("subt");
  file.Put<std::uint32_t>(1);  // version
  file.Put<std::uint64_t>(text.size());
  file.Put<std::uint64_t>(binary.size());
  file.PutBytes(text);
  file.PutBytes(binary);
  return file.Take();
}

}  // namespace terrace::proto
