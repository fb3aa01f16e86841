#include "fly/tree/subtree.h"

#include <exception>
#include <nlohmann/json.hpp>
#include <utility>

#include "engine/core/bytes.h"
#include "fly/scene/json_reason.h"

namespace terrace::fly {
namespace {

using Json = nlohmann::json;

constexpr std::uint32_t kMagic = 0x74627573;  // "subt"

// Interleaves the bits of x and y, x lowest.
std::size_t Morton(std::uint32_t x, std::uint32_t y) {
  std::size_t index = 0;
  for (int bit = 0; bit < 24; ++bit) {
    index |= static_cast<std::size_t>(x >> bit & 1) << (2 * bit) | static_cast<std::size_t>(y >> bit & 1)
                                                                       << (2 * bit + 1);
  }
  return index;
}

std::size_t TilesAbove(int level) { return ((std::size_t{1} << (2 * level)) - 1) / 3; }

tl::unexpected<Error> Damaged(std::string_view what) {
  return MakeError(ErrorCode::kInvalidArgument, "subtree: {}", what);
}

tl::unexpected<Error> NotSupported(std::string_view what) {
  return MakeError(ErrorCode::kNotFound, "subtree: {} not supported; fly reads binary subtrees with their bits inside",
                   what);
}

Result<std::string_view> BitsOf(const Json& json, const Json& availability, std::string_view binary) {
  const Json& view = json.at("bufferViews").at(availability.at("bitstream").get<std::size_t>());
  const Json& buffer = json.at("buffers").at(view.at("buffer").get<std::size_t>());
  if (buffer.contains("uri")) return NotSupported("buffers in other files are");
  const auto offset = view.value("byteOffset", std::size_t{0}), length = view.at("byteLength").get<std::size_t>();
  if (offset > binary.size() || binary.size() - offset < length) return Damaged("its bits are cut off");
  return binary.substr(offset, length);
}

}  // namespace

Result<Subtree3d> Subtree3d::Parse(std::string_view bytes, int levels) {
  if (bytes.starts_with("{")) return NotSupported("JSON is");
  ByteReader reader(bytes);
  const bool is_binary = reader.Get<std::uint32_t>() == kMagic && reader.Get<std::uint32_t>() == 1;
  const auto json_bytes = reader.Get<std::uint64_t>(), binary_bytes = reader.Get<std::uint64_t>();
  if (!is_binary || !reader.ok() || json_bytes > reader.remaining() || binary_bytes > reader.remaining() - json_bytes) {
    return Damaged("no binary subtree, or cut off");
  }
  const std::string_view text = reader.GetBytes(json_bytes), binary = reader.GetBytes(binary_bytes);
  try {
    const Json json = Json::parse(text);
    const auto read = [&](const Json& availability, std::size_t bits) -> Result<Bits> {
      Bits result;
      if (availability.contains("constant")) {
        result.constant = availability.at("constant").get<int>() != 0;
        return result;
      }
      const Result<std::string_view> stream = BitsOf(json, availability, binary);
      if (!stream) return tl::unexpected(stream.error());
      if (stream->size() < (bits + 7) / 8) return Damaged("it has fewer bits than tiles");
      result.bytes.assign(stream->begin(), stream->end());
      return result;
    };
    const Json contents = json.value("contentAvailability", Json::object({{"constant", 0}}));
    Result<Bits> tiles = read(json.at("tileAvailability"), TilesAbove(levels));
    Result<Bits> content = read(contents.is_array() ? contents.at(0) : contents, TilesAbove(levels));
    Result<Bits> subtrees = read(json.at("childSubtreeAvailability"), std::size_t{1} << (2 * levels));
    for (const Result<Bits>* part : {&tiles, &content, &subtrees}) {
      if (!*part) return tl::unexpected(part->error());
    }
    Subtree3d subtree;
    subtree.tiles_ = *std::move(tiles);
    subtree.contents_ = *std::move(content);
    subtree.subtrees_ = *std::move(subtrees);
    return subtree;
  } catch (const std::exception& error) {
    return Damaged(JsonReason(error));
  }
}

bool Subtree3d::HasTile(int level, std::uint32_t x, std::uint32_t y) const {
  return tiles_.Get(TilesAbove(level) + Morton(x, y));
}

bool Subtree3d::HasContent(int level, std::uint32_t x, std::uint32_t y) const {
  return contents_.Get(TilesAbove(level) + Morton(x, y));
}

bool Subtree3d::HasSubtree(std::uint32_t x, std::uint32_t y) const { return subtrees_.Get(Morton(x, y)); }

}  // namespace terrace::fly
